"""Instances that need a prototype of their own: those with matrices that cannot be inverted in single precision, including
flattening ones, whose geometry is computed in double precision, and curves under non-similarity matrices.

Embree transforms rays by the inverse of a single-precision matrix. That is accurate while the images of the axes are nearly
perpendicular, whatever their lengths, and fails if they nearly lie in one plane. Rays are transformed to the space in which the
tubes of curves are round; these are then exactly elliptic in the world.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import Curves, MatrixInstances, Mesh, MovingInstances, Placed, Placement, Prototype, SceneDescription, Shape
from ...description.placement import Instances, PointInstances, all_names, chunks, compose, named_levels, texts

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
