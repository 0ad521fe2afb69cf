"""Instances of curves that overlap, such as tufts of hair on a head, become curves of the world.

Each ray through fur of instances enters all tufts whose boxes it passes, and tests in each the few strands near it. One
hierarchy over all strands finds those that are hit. The decision depends on the scene alone, so that all renders of it agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description import Curves, MovingInstances, Placed, Placement, SceneDescription, Shape
from ..description.placement import Box, all_names, named_levels, transformed_box
from .single_precision import are_similar

# Instances are copied where the middle of one is inside at least this many others' boxes, on average.
OVERLAPPING = 8.0
SAMPLED = 256  # instances whose middles are looked at
MOST_SEGMENTS = 1 << 23  # copies and curves of the world: beyond, Embree's structures for curves are slower (accel/build.cpp)
MOST_INSTANCES = 1 << 17  # each copy is a shape of its own


@dataclass(frozen=True)
class _Candidate:
    """A placement of still curves alone, whose instances may be copied."""

    number: int
    rows: Doubles  # (K, 3, 4), world_from_prototype
    box: Box  # of the prototype
    segments: int  # of all instances


def with_curves_in_world(d: SceneDescription, shapes: Sequence[Shape]) -> tuple[SceneDescription, tuple[Placed, ...]]:
    """Return the description with overlapping instances of curves as further static shapes, and these copies."""
    found = _overlapping(d, shapes)
    if not found:
        return d, ()
    copies = tuple(placed for one in found for placed in _copies(d, d.placements[one.number], one.rows))
    gone = {one.number for one in found}
    left = tuple(placement for k, placement in enumerate(d.placements) if k not in gone)
    return replace(d, static=(*d.static, *copies), placements=left), copies


def copied_segments(d: SceneDescription) -> int:
    """Return the number of segments in all copies."""
    return sum(one.segments for one in _overlapping(d, d.shapes))


def _overlapping(d: SceneDescription, shapes: Sequence[Shape]) -> list[_Candidate]:
    if not d.placements or not any(isinstance(shape, Curves) for shape in shapes):
        return []
    found = _candidates(d, shapes)
    return found if found and _mean_overlap(found) >= OVERLAPPING else []


def _candidates(d: SceneDescription, shapes: Sequence[Shape]) -> list[_Candidate]:
    """Return placements that may be copied, all of them within the limits; none if they exceed these."""
    segments, instances = _segments(d.static, shapes), 0
    found = []
    for number, placement in enumerate(d.placements):
        prototype = d.prototypes[placement.prototype]
        if not _may_be_copied(placement, [shapes[p.shape] for p in prototype.shapes]) or prototype.placements:
            continue
        own = _segments(prototype.shapes, shapes) * len(placement)
        segments, instances = segments + own, instances + len(placement)
        if segments > MOST_SEGMENTS or instances > MOST_INSTANCES:
            return []
        rows = np.concatenate(list(placement.chunks()))
        boxes = [transformed_box(p.matrix, shapes[p.shape].box()) for p in prototype.shapes]
        box = np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
        if are_similar(rows).all():  # tubes are round before any other matrix (single_precision.py)
            found.append(_Candidate(number, rows, box, own))
    return found


def _may_be_copied(placement: Placement, members: Sequence[Shape]) -> bool:
    """Return whether nothing of the instances but their places differs, and they are still curves alone."""
    if placement.primvars or len(placement) < 2 or any(isinstance(level, MovingInstances) for level in placement.levels):
        return False
    still = (isinstance(shape, Curves) and shape.motion is None and shape.light is None for shape in members)
    return bool(members) and all(still)


def _segments(placed: Sequence[Placed], shapes: Sequence[Shape]) -> int:
    return sum(int(shape.segments.sum()) for p in placed if isinstance(shape := shapes[p.shape], Curves))


def _mean_overlap(found: Sequence[_Candidate]) -> float:
    """Return the number of other instances' boxes around the middle of an instance, the mean over a sample of them."""
    boxes = [transformed_box(one.rows, one.box) for one in found]
    low, high = (np.concatenate(corners) for corners in zip(*boxes, strict=True))
    middles = (low + high) / 2
    chosen = np.unique(np.linspace(0, len(middles) - 1, SAMPLED).astype(np.intp))
    around: list[npt.NDArray[np.bool_]] = [((low <= at) & (at <= high)).all(axis=1) for at in middles[chosen]]
    return float(np.mean([inside.sum() for inside in around])) - 1.0


def _copies(d: SceneDescription, placement: Placement, rows: Doubles) -> list[Placed]:
    names = all_names(named_levels(placement.levels))
    matrices = np.broadcast_to(np.eye(4), (len(rows), 4, 4)).copy()
    matrices[:, :3] = rows
    return [
        Placed(p.shape, matrix @ p.matrix, "" if names is None else names.of(k))
        for k, matrix in enumerate(matrices)
        for p in d.prototypes[placement.prototype].shapes
    ]
