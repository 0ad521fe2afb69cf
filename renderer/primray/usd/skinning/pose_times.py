"""Choice of times at which a SkelRoot's skeletons are posed: the samples of what moves them, and as many in between as keep
linear interpolation within an error bound; the frame alone if nothing moves while the shutter is open.

The bound follows from the joints that each mesh's points follow. A skinned point is a weighted mean of its positions under each
of its joints. So its error is at most that of any corner of the bounding box of one joint's points, moved by that joint. Blend
shapes that shift points at the same time add at most a quarter of the product of both changes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from pxr import Usd, UsdGeom

from ...arrays import Doubles
from ..motion.attributes import bend_times, blur_scale_of, is_animated
from ..motion.sample_times import Steps, corners_of, sample_times
from ..motion.timing import Foreseen
from ..stage.reads import default_value, property_names, targets, value_at, world_transform
from ..stage.time_varying import earliest_if_unset, number_of
from ..stage.values import When, array, matrix
from .bindings import SkeletonBinding

if TYPE_CHECKING:
    from pxr import UsdSkel


MOST_POSES = 64  # segments; each pose is a copy of all points
SHARE_OF_ERROR = 0.5  # of the allowed error: rotations of rigidly posed shapes are sampled again later
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
    moving = [a for binding in bindings for a in _attributes(binding) if is_animated(a, when, timing)]
    first, last = timing.looked_at
    if when.is_default:
        first = max(first, 0.0)  # the frame is the first sample's time: nothing moves before it
    if not moving or first == last:
        return None
    paths = frozenset(str(attribute.GetPath()) for attribute in moving)
    if not timing.is_open:
        stills = {min(max(timing.opens * scale, first), last) for scale in scales}
        return PoseTimes(tuple(sorted({0.0, *stills})), paths)
    knots = [offset for offset in bend_times(moving, when, timing) if first < offset < last]
    base = _reference_time(moving, when)
    ends = tuple(sorted({first, 0.0, last}))
    meshes = [
        PosedMesh(binding, query, lambda offset: Usd.TimeCode(base + offset), ends)
        for binding in bindings
        for query in binding.targets
    ]
    steps = _pose_steps(first, last, knots, meshes, seen, is_placed)
    inside = {first + (last - first) * fraction for fraction in steps.times[1:-1]}
    return PoseTimes(tuple(sorted({*ends, *inside})), paths, steps)


def _pose_steps(
    first: float, last: float, knots: list[float], meshes: list[PosedMesh], seen: Foreseen, is_placed: bool
) -> Steps:
    """Return the steps as fractions of the interval between the first and last offset."""
    knots = [*knots, *(time for mesh in meshes for time in _bends_of_blends(mesh, [first, *sorted(knots), last]))]
    scaled = [(mesh, scale) for mesh in meshes if (scale := mesh.scale(seen, is_placed)) > 0.0]

    def error(a: float, b: float, time: float) -> float:
        a, b, time = (first + (last - first) * fraction for fraction in (a, b, time))
        return max((scale * mesh.error(a, b, time) for mesh, scale in scaled), default=0.0)

    bent = [(offset - first) / (last - first) for offset in knots]
    # All samples are kept: the posed points show later which ones can be left out.
    return sample_times(error, bent, SHARE_OF_ERROR * seen.most, -1.0, MOST_POSES)


def _reference_time(moving: list[Usd.Attribute], when: When) -> float:
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
        apart = _with_ancestors(binding.skeleton), _with_ancestors(query.GetPrim())
        shared = {prim.GetPath() for prim in apart[0]} & {prim.GetPath() for prim in apart[1]}
        for prim in itertools.chain(*apart):
            if prim.GetPath() not in shared:
                yield from (prim.GetAttribute(name) for name in property_names(prim) if name.startswith("xformOp:"))


def _with_ancestors(prim: Usd.Prim) -> list[Usd.Prim]:
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


At = Callable[[float], Usd.TimeCode]  # offset from the frame -> time code


@dataclass(frozen=True)
class BlendReach:
    """Bounds on how far a blend shape shifts any point."""

    farthest: float  # for weights from 0 to 1
    steepest: float  # per unit of weight
    bends: tuple[float, ...]  # weights at which point paths bend, as at in-between shapes

    def at(self, weight: float) -> float:
        return self.farthest + self.steepest * max(-weight, weight - 1.0, 0.0)


class PosedMesh:
    def __init__(self, binding: SkeletonBinding, query: UsdSkel.SkinningQuery, at: At, ends: Iterable[float]) -> None:
        self.prim = query.GetPrim()
        self._binding, self._query, self._at = binding, query, at
        self._known: dict[float, Doubles] = {}
        self._ends = tuple(ends)
        self.blends = blend_reaches(query)
        self._order = [str(name) for name in binding.query.GetBlendShapeOrder() or ()] if self.blends else []
        self._joints, self._corners = self._boxes()

    def weights(self, offset: float) -> Doubles:
        """Return the weights (K,) of the mesh's blend shapes, in the order of `blends`."""
        found = self._binding.query.ComputeBlendShapeWeights(self._at(offset)) if self.blends else None
        by_name = dict(zip(self._order, found or (), strict=False))
        return np.array([by_name.get(name, 0.0) for name in self.blends], np.float64)

    def error(self, a: float, b: float, time: float) -> float:
        """Return the error bound at offset `time`, in the mesh's own space, of poses linear between the offsets `a` and `b`."""
        u = (time - a) / (b - a)
        first, last, true = self._matrices(a), self._matrices(b), self._matrices(time)
        apart = self._moved(first + u * (last - first) - true)
        left = float(np.linalg.norm(apart, axis=2).max()) if apart.size else 0.0
        if self.blends:
            shifted = float(np.abs(self.weights(b) - self.weights(a)) @ self._steepest)
            turned = np.linalg.norm(last[:, :3, :3] - first[:, :3, :3], axis=(1, 2)).max() if len(first) else 0.0
            left += u * (1.0 - u) * shifted * float(turned)
        return left

    def scale(self, seen: Foreseen, is_placed: bool) -> float:
        """Return the largest number of pixels per unit of length in the mesh's own space."""
        boxes, stretch = [], 0.0
        for offset in self._ends:
            world = world_transform(UsdGeom.XformCache(self._at(offset)), self.prim)
            placed = np.eye(4) if world is None else matrix(world)
            points = self._moved(self._matrices(offset)).reshape(-1, 3) @ placed[:3, :3].T + placed[:3, 3]
            boxes += [points.min(axis=0), points.max(axis=0)] if len(points) else []
            stretch = max(stretch, float(np.linalg.norm(placed[:3, :3], ord=2)))
        if not boxes:
            return 0.0
        low, high = np.min(boxes, axis=0), np.max(boxes, axis=0)
        return stretch * float(seen.per_length(low[None], high[None], is_placed)[0])

    def _matrices(self, offset: float) -> Doubles:
        """Return mesh_from_rest (J, 4, 4) of the joints that the mesh follows."""
        if offset not in self._known:
            time = self._at(offset)
            found = self._binding.poses.ComputeSkinningTransforms(time) if self._joints else None
            joints = np.array(found, np.float64).reshape(-1, 4, 4)[self._joints] if found else np.zeros((0, 4, 4))
            cache = UsdGeom.XformCache(time)
            skeleton, mesh = (world_transform(cache, prim) for prim in (self._binding.skeleton, self.prim))
            relative = np.eye(4) if skeleton is None or mesh is None else np.array(skeleton * mesh.GetInverse())
            bound = np.array(self._query.GetGeomBindTransform(time))
            self._known[offset] = (bound @ joints @ relative).transpose(0, 2, 1)
        return self._known[offset]

    def _moved(self, matrices: Doubles) -> Doubles:
        """Return the moved corners (J, 8, 3) of each joint's box."""
        return np.asarray(np.einsum("jik,jck->jci", matrices[:, :3, :3], self._corners) + matrices[:, None, :3, 3])

    def _boxes(self) -> tuple[list[int], Doubles]:
        """Return the indices of the joints in the skeleton, and the corners (J, 8, 3) of the bounding box of the points that
        each moves."""
        time = self._at(0.0)
        points = array(value_at(UsdGeom.PointBased(self.prim).GetPointsAttr(), time), 3, "f") if self._query else None
        found = self._query.ComputeJointInfluences(time) if self._query.HasJointInfluences() else None
        if points is None or not len(points) or not found:
            return [], np.zeros((0, 8, 3))
        indices, weights = np.array(found[0]), np.array(found[1])
        owners = np.arange(len(indices)) // max(self._query.GetNumInfluencesPerComponent(), 1)
        names = self._query.GetJointOrder() or self._binding.joints
        numbers = {name: k for k, name in enumerate(self._binding.joints)}
        reach = self._shifted()
        joints, corners = [], []
        for joint in np.unique(indices[weights > 0]).tolist():
            own = owners[(indices == joint) & (weights > 0)]
            mine = points if self._query.IsRigidlyDeformed() else points[own[own < len(points)]]
            if joint < len(names) and names[joint] in numbers and len(mine):
                joints.append(numbers[names[joint]])
                corners.append(corners_of(mine.min(axis=0) - reach, mine.max(axis=0) + reach))
        return joints, np.array(corners, np.float64).reshape(-1, 8, 3)

    @cached_property
    def _steepest(self) -> Doubles:
        return np.array([reach.steepest for reach in self.blends.values()])

    def _shifted(self) -> float:
        """Return the largest distance by which the blend shapes shift any point."""
        reaches = self.blends.values()
        then = [sum(r.at(w) for r, w in zip(reaches, self.weights(offset).tolist(), strict=True)) for offset in self._ends]
        return float(max(then, default=0.0))


def blend_reaches(query: UsdSkel.SkinningQuery) -> dict[str, BlendReach]:
    """Return the bounds of a mesh's blend shapes, keyed by the names in animations."""
    if not query.HasBlendShapes():
        return {}
    from pxr import UsdSkel

    found = {}
    stage = query.GetPrim().GetStage()
    paths = targets(query.GetPrim(), "skel:blendShapeTargets")
    for name, path in zip(query.GetBlendShapeOrder() or (), paths, strict=False):
        shape = UsdSkel.BlendShape(stage.GetPrimAtPath(path))
        if shape:
            found[str(name)] = _reach_of(shape)
    return found


def _reach_of(shape: UsdSkel.BlendShape) -> BlendReach:
    """Return the bounds of one blend shape: points move linearly between adjacent in-between weights, and beyond the ends as in
    the outer intervals."""
    inner = shape.GetInbetweens()
    steps = [(0.0, 0.0), (1.0, _farthest(default_value(shape.GetOffsetsAttr())))]
    steps = sorted([*steps, *((float(one.GetWeight() or 0.0), _farthest(one.GetOffsets())) for one in inner)])
    gaps = [(b[0] - a[0], a[1] + b[1]) for a, b in itertools.pairwise(steps)]
    steepest = max((shift / gap for gap, shift in gaps if gap > 0.0), default=0.0)
    return BlendReach(max(step[1] for step in steps), steepest, tuple(step[0] for step in steps) if inner else ())


def _farthest(offsets: object) -> float:
    rows = array(offsets, 3, "f")
    return float(np.linalg.norm(rows, axis=1).max()) if rows is not None and len(rows) else 0.0
