"""Geometry that single precision cannot hold: what is too far away, and instances that need a prototype of their own.

The origin of the core's coordinates is near the camera, on a grid, so that cameras near each other share it; outliers are
excluded from the scene's scale, and distant geometry is left out with a diagnostic. Embree silently ignores what reaches beyond
1.844e18; shading squares a triangle's cross product.

Embree transforms rays by the inverse of a single-precision matrix. That is accurate while the images of the axes are nearly
perpendicular, whatever their lengths, and fails if they nearly lie in one plane. Instances with matrices that cannot be
inverted in single precision, including flattening ones, get prototypes whose geometry is computed in double precision. So do
curves under non-similarity matrices: rays are transformed to the space in which the tubes of curves are round; these are then
exactly elliptic in the world.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..camera import Camera
from ..description import Curves, MatrixInstances, Mesh, MovingInstances, Placed, Prototype, SceneDescription, Shape
from ..description.placement import (
    Box,
    Instances,
    Placement,
    PointInstances,
    all_names,
    chunks,
    compose,
    named_levels,
    texts,
    transformed_boxes,
)

# Geometry farther from the camera than the nearest shape or the median instance by this factor is excluded from the scene's
# scale: otherwise the rest would be too small to be hit in single precision (products of three lengths below 1e-38).
OUTLYING = 2.0**24

FARTHEST = 1e18  # in the core's length unit

Flags = npt.NDArray[np.bool_]


def boxes_without_outliers(boxes: Doubles, shapes: Sequence[Shape]) -> Doubles:
    """Return the boxes (S, 2, 3) without the few points of a mesh that are extremely far from its others."""
    far = np.flatnonzero(np.abs(boxes).max(axis=(1, 2), initial=0.0) > OUTLYING)
    if len(far) == 0:
        return boxes
    usual = boxes.copy()
    for k in far.tolist():
        shape = shapes[k]
        if isinstance(shape, Mesh) and len(shape.triangles):
            usual[k] = _box_of_most(shape.points[np.unique(shape.triangles)].astype(np.float64))
    return usual


def _box_of_most(points: Doubles) -> Doubles:
    distance = np.abs(points - np.quantile(points, 0.5, axis=0, method="lower")).max(axis=1)
    usual = float(np.quantile(distance, 0.5, method="lower"))
    kept = points[distance <= OUTLYING * usual] if usual > 0 else points
    return np.array([kept.min(axis=0), kept.max(axis=0)])


def union_without_outliers(boxes: Doubles) -> Box:
    """Return the union of boxes (S, 2, 3) without those that are extremely far from the others."""
    if len(boxes) == 0:
        return np.zeros(3), np.zeros(3)
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    if len(boxes) > 1 and np.max(high - low) > OUTLYING:
        center = np.quantile(boxes.mean(axis=1), 0.5, axis=0, method="lower")
        distance = np.abs(boxes - center).max(axis=(1, 2))
        near = distance <= OUTLYING * np.min(distance[distance > 0], initial=np.inf)
        low, high = boxes[near, 0].min(axis=0), boxes[near, 1].max(axis=0)
    return low, high


def representable_triangles(mesh: Mesh, core_from_object: Doubles) -> tuple[Flags, int]:
    """Return the mask (T,) of triangles that single precision can hold, and the number of these that reach so far that their
    edges are off by a unit or more."""
    with np.errstate(over="ignore", invalid="ignore"):
        points = mesh.points.astype(np.float64) @ core_from_object[:3, :3].T + core_from_object[:3, 3]
        p = points[mesh.triangles]
        doubled_area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
        reach = np.abs(p).max(axis=(1, 2))
        near = np.asarray((reach < FARTHEST) & (doubled_area < FARTHEST))
    return near, int((near & (reach > OUTLYING)).sum())


@dataclass(frozen=True)
class FarInstances:
    """Instances whose `box` reaches `limit` or farther from `center`."""

    box: Box
    center: Doubles
    limit: float

    def _are_far(self, rows: Doubles) -> Flags:
        with np.errstate(over="ignore", invalid="ignore"):
            low, high = transformed_boxes(rows, *(np.broadcast_to(corner, (len(rows), 3)) for corner in self.box))
            reach = np.maximum(np.abs(low - self.center), np.abs(high - self.center)).max(axis=1)
        return np.asarray(np.isfinite(rows).all(axis=(1, 2)) & ~(reach < self.limit))

    def removed(self, rows: Doubles) -> Doubles:
        """Return rows (K, 3, 4) with NaN for far instances, which the core leaves out."""
        kept = rows.copy()
        kept[self._are_far(rows)] = np.nan
        return kept

    def count(self, placement: Placement) -> int:
        return sum(int(self._are_far(rows).sum()) for rows in placement.chunks())


# Cell size relative to the near plane's distance, at most. Everything visible is beyond that plane, so that single precision
# moves it by less than 4e-7 of its distance (a thousandth of a pixel) instead of 6e-8.
CELLS = 8.0


def rebasing_origin(camera: Camera) -> Doubles:
    """Return the origin (3,) in world space. Cell sizes are powers of two, so that grid points are exact however far from the
    world's origin.

    It depends on the camera alone: other geometry never changes the bits of what is visible.
    """
    eye: Doubles = camera.world_from_camera[:3, 3]
    near = camera.nearest or camera.clipping_range[0]
    if not 0 < near < np.inf:
        return eye
    cell = 2.0 ** np.floor(np.log2(CELLS * near))
    with np.errstate(invalid="ignore", over="ignore"):
        snapped: Doubles = np.round(eye / cell) * cell
    return snapped if np.isfinite(snapped).all() else eye


# Volume spanned by the images of the axes, relative to a box of their lengths: instances below this are skewed.
SKEWED = 0.02
# If no level stretches one direction this much more than another, no instance can be skewed.
STRETCH = 6.0
# Limit on the triangles in all copies; skewed instances beyond it remain instances.
MAX_COPIED_TRIANGLES = 1 << 22
MAX_COPIES = 1 << 12


def separate_skewed(d: SceneDescription, shapes: Sequence[Shape]) -> SceneDescription:
    """Return the description with a prototype of its own for each skewed instance of shapes; those that span no area are left
    unchanged."""
    baking = _Separation(list(d.prototypes), shapes)
    top = baking.without_skewed(d.placements)
    for i, proto in enumerate(d.prototypes):
        if proto.placements:
            baking.prototypes[i] = replace(proto, placements=baking.without_skewed(proto.placements))
    if len(baking.prototypes) == len(d.prototypes):
        return d
    return replace(d, prototypes=tuple(baking.prototypes), placements=top)


class _Separation:
    def __init__(self, prototypes: list[Prototype], shapes: Sequence[Shape]) -> None:
        self.prototypes = prototypes
        self._shapes = shapes
        self._triangles = self._copies = 0

    def without_skewed(self, placements: tuple[Placement, ...]) -> tuple[Placement, ...]:
        return tuple(part for placement in placements for part in self._parts(placement))

    def _parts(self, placement: Placement) -> list[Placement]:
        proto = self.prototypes[placement.prototype]
        # Matrices of moving instances are inverted in double precision for each ray.
        if proto.placements or any(isinstance(level, MovingInstances) for level in placement.levels):
            return [placement]
        skewed = _skewed(placement.levels)
        each = sum(len(s.triangles) for s in (self._shapes[p.shape] for p in proto.shapes) if isinstance(s, Mesh))
        room = min(MAX_COPIES - self._copies, (MAX_COPIED_TRIANGLES - self._triangles) // max(each, 1))
        skewed = skewed[: max(room, 0)]
        if len(skewed) == 0:
            return [placement]
        self._copies += len(skewed)
        self._triangles += each * len(skewed)
        count = len(placement)
        level = placement.levels[0]
        if len(placement.levels) > 1:
            names = all_names(named_levels(placement.levels))
            level = MatrixInstances(np.concatenate(list(placement.chunks())), names=names)
        rest = np.ones(count, np.bool_)
        rest[skewed] = False
        parts = [_chosen_instances(placement, placement.prototype, level.take(rest), rest)] if rest.any() else []
        rows = level.take(skewed).rows(0, len(skewed))
        return parts + [self._copy(placement, level, row, k) for row, k in zip(rows, skewed, strict=True)]

    def _copy(self, placement: Placement, level: Instances, row: Doubles, k: np.int64) -> Placement:
        proto = self.prototypes[placement.prototype]
        linear, stands = np.eye(4), np.eye(4)
        linear[:3, :3], stands[:3, 3] = row[:, :3], row[:, 3]
        number = len(self.prototypes)
        self.prototypes.append(Prototype(proto.path, tuple(Placed(p.shape, linear @ p.matrix) for p in proto.shapes)))
        names = None if level.names is None else level.names.take(np.array([k]))
        return _chosen_instances(placement, number, MatrixInstances(stands[None, :3], names=names), np.array([k]))


def _chosen_instances(
    placement: Placement, prototype: int, level: Instances, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.int64]
) -> Placement:
    primvars = tuple(replace(p, values=p.values[chosen]) for p in placement.primvars)
    return Placement(prototype, (replace(level, primvars=()),), primvars)


def _skewed(levels: Sequence[Instances]) -> npt.NDArray[np.int64]:
    """Return the indices of skewed instances; most placements can be excluded without examining each instance."""
    *outer, last = levels
    if isinstance(last, PointInstances) and math.prod(map(_stretch, outer)) * _condition(last.outer) <= STRETCH:
        # Rotated and scaled axes are perpendicular, so only a scale of 0 can remove their volume.
        if last.scales is None or last.scales.all() or outer:
            return np.zeros(0, np.int64)
        flat = np.flatnonzero((last.scales == 0).sum(axis=1) == 1)
        return flat[_is_skewed(last.take(flat).rows(0, len(flat)))]
    return np.flatnonzero(np.concatenate([_is_skewed(rows) for rows in chunks(levels)]))


def _stretch(level: Instances) -> float:
    """Return an upper bound on how much more the level's matrices stretch one direction than another."""
    if not isinstance(level, PointInstances):
        with np.errstate(all="ignore"):
            return float(np.linalg.cond(level.rows(0, len(level))[:, :, :3]).max(initial=1.0))
    sizes = np.ones(1) if level.scales is None else np.abs(level.scales.astype(np.float64))
    smallest = float(sizes.min(initial=np.inf))
    return _condition(level.outer) * (float(sizes.max(initial=0.0)) / smallest if smallest > 0 else np.inf)


def _condition(m: Doubles) -> float:
    return float(np.linalg.cond(m[:, :3])) if np.isfinite(m).all() else math.inf


def _is_skewed(rows: Doubles) -> npt.NDArray[np.bool_]:
    """Return the mask of matrices (n, 3, 4) that are finite, and map the axes to vectors spanning an area but almost no
    volume."""
    with np.errstate(all="ignore"):
        finite = np.isfinite(rows).all(axis=(1, 2))
        size = np.abs(rows[:, :, :3]).max(axis=(1, 2), keepdims=True)
        x, y, z = (rows[:, :, :3] / size).transpose(2, 0, 1)
        normals = np.cross(y, z)
        volume = np.abs((x * normals).sum(axis=1))
        lengths = [np.linalg.norm(v, axis=1) for v in (x, y, z)]
        area = np.max([np.linalg.norm(n, axis=1) for n in (normals, np.cross(z, x), np.cross(x, y))], axis=0)
        skewed = ~(volume > SKEWED * lengths[0] * lengths[1] * lengths[2])
        return np.asarray(finite & skewed & (area > 1e-15))


ROUND = 1e-5  # largest deviation from a similarity, relative to the matrix's size


def separate_stretched_curves(d: SceneDescription, shapes: Sequence[Shape]) -> SceneDescription:
    """Return the description with a separate prototype for every placement of such curves, placed wherever the original was."""
    if not any(isinstance(shape, Curves) for shape in shapes):
        return d
    prototypes, placements = list(d.prototypes), list(d.placements)
    static, apart = _split_stretched(d.static, shapes)
    for placed in apart:
        names = texts([placed.instance]) if placed.instance else None
        placements.append(Placement(len(prototypes), (MatrixInstances(placed.matrix[None, :3], names=names),)))
        prototypes.append(_prototype_of(placed, shapes))
    for k, prototype in enumerate(d.prototypes):
        kept, apart = _split_stretched(prototype.shapes, shapes)
        if not apart:
            continue
        prototypes[k] = replace(prototype, shapes=kept)
        for placed in apart:
            number = len(prototypes)
            prototypes.append(_prototype_of(placed, shapes))
            placements += _placed_again(placements, k, number, placed)
            for g, outer in enumerate(prototypes):
                if outer.placements:
                    more = tuple(_placed_again(outer.placements, k, number, placed))
                    prototypes[g] = replace(outer, placements=(*outer.placements, *more))
    return replace(d, static=static, prototypes=tuple(prototypes), placements=tuple(placements))


def is_similar(m: Doubles) -> bool:
    """Return whether a matrix scales equally in all directions."""
    linear = m[:3, :3]
    square = linear.T @ linear
    size = np.trace(square) / 3
    return bool(size > 0 and np.abs(square - size * np.eye(3)).max() <= ROUND * size)


def are_similar(rows: Doubles) -> Flags:
    """Return the mask of matrices (n, 3, 4) that `is_similar` holds for."""
    with np.errstate(all="ignore"):
        square = rows[:, :, :3].transpose(0, 2, 1) @ rows[:, :, :3]
        size = np.trace(square, axis1=1, axis2=2) / 3
        off = np.abs(square - size[:, None, None] * np.eye(3)).max(axis=(1, 2))
        return np.asarray((size > 0) & (off <= ROUND * size))


def _split_stretched(placed: Sequence[Placed], shapes: Sequence[Shape]) -> tuple[tuple[Placed, ...], list[Placed]]:
    stretched = [isinstance(shapes[p.shape], Curves) and not is_similar(p.matrix) for p in placed]
    kept = tuple(p for p, is_apart in zip(placed, stretched, strict=True) if not is_apart)
    return kept, [p for p, is_apart in zip(placed, stretched, strict=True) if is_apart]


def _prototype_of(placed: Placed, shapes: Sequence[Shape]) -> Prototype:
    return Prototype(shapes[placed.shape].path, (Placed(placed.shape, np.eye(4)),))


def _placed_again(placements: Sequence[Placement], prototype: int, number: int, placed: Placed) -> list[Placement]:
    """Return placements of the new prototype wherever the original is, with one more matrix."""
    return [
        replace(p, prototype=number, levels=_with_inner_matrix(p.levels, placed.matrix[:3]))
        for p in placements
        if p.prototype == prototype
    ]


def _with_inner_matrix(levels: tuple[Instances, ...], inner: Doubles) -> tuple[Instances, ...]:
    last = levels[-1]
    if isinstance(last, MatrixInstances):
        return (*levels[:-1], replace(last, matrices=compose(last.matrices, inner[None])))
    if isinstance(last, MovingInstances):
        steps = np.stack([compose(step, inner[None]) for step in last.matrices])
        return (*levels[:-1], replace(last, matrices=steps, frame=compose(last.frame, inner[None])))
    return (*levels, MatrixInstances(inner[None]))
