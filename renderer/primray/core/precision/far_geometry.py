"""Geometry too far away for single precision: the origin of the core's coordinates, outliers excluded from the scene's scale,
and distant geometry left out with a diagnostic.

The origin is near the camera, on a grid, so that cameras near each other share it. Embree silently ignores what reaches beyond
1.844e18; shading squares a triangle's cross product.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...camera import Camera
from ...description import Mesh, Shape
from ...description.placement import Box, Placement, transformed_boxes

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
    near = camera.clipping_range[0]
    if not 0 < near < np.inf:
        return eye
    cell = 2.0 ** np.floor(np.log2(CELLS * near))
    with np.errstate(invalid="ignore", over="ignore"):
        snapped: Doubles = np.round(eye / cell) * cell
    return snapped if np.isfinite(snapped).all() else eye
