"""Conversion of instances whose matrices cannot be inverted in single precision, including flattening ones, to geometry
computed in double precision.

Embree transforms rays by the inverse of a single-precision matrix. That is accurate while the images of the axes are nearly
perpendicular, whatever their lengths, and fails if they nearly lie in one plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description import MatrixInstances, Mesh, MovingInstances, Placed, Placement, Prototype, SceneDescription, Shape
from ..description.instance_names import all_names
from ..description.placement import Instances, PointInstances, chunks, named_levels

# Volume spanned by the images of the axes, relative to a box of their lengths: instances below this are skewed.
SKEWED = 0.02
# If no level stretches one direction this much more than another, no instance can be skewed.
STRETCH = 6.0
# Limit on the triangles in all copies; skewed instances beyond it remain instances.
MAX_TRIANGLES = 1 << 22
MAX_COPIES = 1 << 12


def bake_skewed(d: SceneDescription, shapes: Sequence[Shape]) -> SceneDescription:
    """Return the description with a prototype of its own for each skewed instance of shapes; those that span no area are left
    unchanged."""
    baking = _Baking(list(d.prototypes), shapes)
    top = baking.without_skewed(d.placements)
    for i, proto in enumerate(d.prototypes):
        if proto.placements:
            baking.prototypes[i] = replace(proto, placements=baking.without_skewed(proto.placements))
    if len(baking.prototypes) == len(d.prototypes):
        return d
    return replace(d, prototypes=tuple(baking.prototypes), placements=top)


class _Baking:
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
        room = min(MAX_COPIES - self._copies, (MAX_TRIANGLES - self._triangles) // max(each, 1))
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
        parts = [_some(placement, placement.prototype, level.take(rest), rest)] if rest.any() else []
        rows = level.take(skewed).rows(0, len(skewed))
        return parts + [self._copy(placement, level, row, k) for row, k in zip(rows, skewed, strict=True)]

    def _copy(self, placement: Placement, level: Instances, row: Doubles, k: np.int64) -> Placement:
        proto = self.prototypes[placement.prototype]
        linear, stands = np.eye(4), np.eye(4)
        linear[:3, :3], stands[:3, 3] = row[:, :3], row[:, 3]
        number = len(self.prototypes)
        self.prototypes.append(Prototype(proto.path, tuple(Placed(p.shape, linear @ p.matrix) for p in proto.shapes)))
        names = None if level.names is None else level.names.take(np.array([k]))
        return _some(placement, number, MatrixInstances(stands[None, :3], names=names), np.array([k]))


def _some(
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
