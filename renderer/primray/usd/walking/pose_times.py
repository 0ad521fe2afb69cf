"""Choice of times at which a SkelRoot's skeletons are posed: the samples of what moves them, and as many in between as keep
linear interpolation within an error bound; the frame alone if nothing moves while the shutter is open."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

from pxr import Usd

from ..moving.foreseen import Foreseen
from ..moving.steps import Steps, steps_of
from ..paths.changes import bends, blur_scale_of, moves
from ..stage.reads import property_names
from ..stage.time_varying import earliest_if_unset, number_of
from ..stage.values import When
from .pose_error import PosedMesh
from .skeleton_bindings import SkeletonBinding

MOST_POSES = 64  # segments; each pose is a copy of all points
SHARE = 0.5  # of the allowed error: rotations of rigidly posed shapes are sampled again later
_ANIMATED = ("translations", "rotations", "scales", "blendShapeWeights")


@dataclass(frozen=True, eq=False)
class PoseTimes:
    """Offsets of the poses from the frame, ascending, including 0."""

    offsets: tuple[float, ...]
    moving: frozenset[str]  # paths of the attributes to author at each of them
    steps: Steps | None = None  # None for stills


def pose_times(bindings: list[SkeletonBinding], when: When, seen: Foreseen, is_placed: bool) -> PoseTimes | None:
    """Return the pose times, or None if the pose at the frame suffices."""
    scales = {blur_scale_of(query.GetPrim()) for binding in bindings for query in binding.targets}
    if seen.timing.is_frame or not scales:
        return None
    timing = replace(seen.timing, blur_scale=max(scales))
    moving = [a for binding in bindings for a in _attributes(binding) if moves(a, when, timing)]
    first, last = timing.looked_at
    if when.is_default:
        first = max(first, 0.0)  # the frame is the first sample's time: nothing moves before it
    if not moving or first == last:
        return None
    paths = frozenset(str(attribute.GetPath()) for attribute in moving)
    if not timing.is_open:
        stills = {min(max(timing.opens * scale, first), last) for scale in scales}
        return PoseTimes(tuple(sorted({0.0, *stills})), paths)
    knots = [offset for offset in bends(moving, when, timing) if first < offset < last]
    base = _base(moving, when)
    ends = tuple(sorted({first, 0.0, last}))
    meshes = [
        PosedMesh(binding, query, lambda offset: Usd.TimeCode(base + offset), ends)
        for binding in bindings
        for query in binding.targets
    ]
    steps = _steps(first, last, knots, meshes, seen, is_placed)
    inside = {first + (last - first) * fraction for fraction in steps.times[1:-1]}
    return PoseTimes(tuple(sorted({*ends, *inside})), paths, steps)


def _steps(first: float, last: float, knots: list[float], meshes: list[PosedMesh], seen: Foreseen, is_placed: bool) -> Steps:
    """Return the steps as fractions of the interval between the first and last offset."""
    knots = [*knots, *(time for mesh in meshes for time in _bends_of_blends(mesh, [first, *sorted(knots), last]))]
    scaled = [(mesh, scale) for mesh in meshes if (scale := mesh.scale(seen, is_placed)) > 0.0]

    def error(a: float, b: float, time: float) -> float:
        a, b, time = (first + (last - first) * fraction for fraction in (a, b, time))
        return max((scale * mesh.error(a, b, time) for mesh, scale in scaled), default=0.0)

    bent = [(offset - first) / (last - first) for offset in knots]
    # All samples are kept: the posed points show later which ones can be left out.
    return steps_of(error, bent, SHARE * seen.most, -1.0, MOST_POSES)


def _base(moving: list[Usd.Attribute], when: When) -> float:
    """Return the time that offsets are relative to when errors are estimated; for the default time, the first sample's time."""
    if not when.is_default:
        return when.number
    earliest = ((attribute, earliest_if_unset(attribute)) for attribute in moving)
    firsts = [number_of(time, attribute) for attribute, time in earliest if time is not None]
    return min((first for first in firsts if first is not None), default=0.0)


def _attributes(binding: SkeletonBinding) -> Iterator[Usd.Attribute]:
    """Yield the attributes that the pose depends on: animations, and transforms between skeletons and their meshes."""
    if binding.animation:
        yield from (a for name in _ANIMATED if (a := binding.animation.GetAttribute(name)))
    for query in binding.targets:
        apart = _above(binding.skeleton), _above(query.GetPrim())
        shared = {prim.GetPath() for prim in apart[0]} & {prim.GetPath() for prim in apart[1]}
        for prim in itertools.chain(*apart):
            if prim.GetPath() not in shared:
                yield from (prim.GetAttribute(name) for name in property_names(prim) if name.startswith("xformOp:"))


def _above(prim: Usd.Prim) -> list[Usd.Prim]:
    """Return the prim and its ancestors."""
    found = []
    while prim and not prim.IsPseudoRoot():
        found.append(prim)
        prim = prim.GetParent()
    return found


def _bends_of_blends(mesh: PosedMesh, offsets: list[float]) -> Iterator[float]:
    """Yield the times at which blend shape weights, linear between samples, pass weights where point paths bend."""
    kinks = [reach.bends for reach in mesh.blends.values()]
    if not any(kinks):
        return
    for start, end in itertools.pairwise(offsets):
        for a, b, weights in zip(mesh.weights(start), mesh.weights(end), kinks, strict=True):
            passed = (w for w in weights if (a - w) * (b - w) < 0.0)
            yield from (start + (end - start) * float((w - a) / (b - a)) for w in passed)
