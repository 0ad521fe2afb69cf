"""At which times skeletons pose what is below a SkelRoot: at the samples of what moves it, and so often that lines between the
poses are close to them. Only at the frame where nothing of that moves while the shutter is open."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

from pxr import Usd

from ..moving.foreseen import Foreseen
from ..moving.steps import Steps, steps_of
from ..paths.changes import bends, blur_scale_of, moves
from ..querying.guarded import property_names
from ..querying.time_varying import earliest_if_unset, number_of
from ..resolving.read import When
from .pose_error import PosedMesh
from .skeleton_bindings import SkeletonBinding

MOST_POSES = 64  # segments: each is a copy of all points
SHARE = 0.5  # of the error that paths may have: what poses rigidly has its rotations looked at again
_ANIMATED = ("translations", "rotations", "scales", "blendShapeWeights")


@dataclass(frozen=True, eq=False)
class PoseTimes:
    """Offsets from the frame, ascending, 0 among them."""

    offsets: tuple[float, ...]
    moving: frozenset[str]  # paths of the attributes that are to be held at each of them
    steps: Steps | None = None  # None: they are what stills of an instant are read at


def pose_times(bindings: list[SkeletonBinding], when: When, seen: Foreseen, is_placed: bool) -> PoseTimes | None:
    """None where the pose at the frame is all there is to see."""
    scales = {blur_scale_of(query.GetPrim()) for binding in bindings for query in binding.targets}
    if seen.timing.is_frame or not scales:
        return None
    timing = replace(seen.timing, blur_scale=max(scales))
    moving = [a for binding in bindings for a in _attributes(binding) if moves(a, when, timing)]
    first, last = timing.looked_at
    if when.is_default:
        first = max(first, 0.0)  # the frame stands for the first sample: before it nothing moves
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
    """Fractions of what is from the first offset to the last."""
    knots = [*knots, *(time for mesh in meshes for time in _bends_of_blends(mesh, [first, *sorted(knots), last]))]
    scaled = [(mesh, scale) for mesh in meshes if (scale := mesh.scale(seen, is_placed)) > 0.0]

    def error(a: float, b: float, time: float) -> float:
        a, b, time = (first + (last - first) * fraction for fraction in (a, b, time))
        return max((scale * mesh.error(a, b, time) for mesh, scale in scaled), default=0.0)

    bent = [(offset - first) / (last - first) for offset in knots]
    # Samples are kept: which can be left out is seen better by the posed points.
    return steps_of(error, bent, SHARE * seen.most, -1.0, MOST_POSES)


def _base(moving: list[Usd.Attribute], when: When) -> float:
    """What offsets count from, as errors are estimated: at the default time the first value that there is."""
    if not when.is_default:
        return when.number
    earliest = ((attribute, earliest_if_unset(attribute)) for attribute in moving)
    firsts = [number_of(time, attribute) for attribute, time in earliest if time is not None]
    return min((first for first in firsts if first is not None), default=0.0)


def _attributes(binding: SkeletonBinding) -> Iterator[Usd.Attribute]:
    """What the pose depends on: the animation, and how the skeleton stands to what it moves."""
    if binding.animation:
        yield from (a for name in _ANIMATED if (a := binding.animation.GetAttribute(name)))
    for query in binding.targets:
        apart = _above(binding.skeleton), _above(query.GetPrim())
        shared = {prim.GetPath() for prim in apart[0]} & {prim.GetPath() for prim in apart[1]}
        for prim in itertools.chain(*apart):
            if prim.GetPath() not in shared:
                yield from (prim.GetAttribute(name) for name in property_names(prim) if name.startswith("xformOp:"))


def _above(prim: Usd.Prim) -> list[Usd.Prim]:
    """Itself and what is above it."""
    found = []
    while prim and not prim.IsPseudoRoot():
        found.append(prim)
        prim = prim.GetParent()
    return found


def _bends_of_blends(mesh: PosedMesh, offsets: list[float]) -> Iterator[float]:
    """When weights pass those at which their blend shapes go another way; between samples they change evenly."""
    kinks = [reach.bends for reach in mesh.blends.values()]
    if not any(kinks):
        return
    for start, end in itertools.pairwise(offsets):
        for a, b, weights in zip(mesh.weights(start), mesh.weights(end), kinks, strict=True):
            passed = (w for w in weights if (a - w) * (b - w) < 0.0)
            yield from (start + (end - start) * float((w - a) / (b - a)) for w in passed)
