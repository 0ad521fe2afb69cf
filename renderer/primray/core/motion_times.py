"""Motion sample times of shapes: within a group the core uses one set of times, which must be uniform in the world.

In the world, the uniform times of most points are kept; shapes with others become prototypes placed once. In a prototype, all
shapes get the union of all times: points are linear between times, so additional ones change nothing. Motions of more than
MOST_SEGMENTS, Embree's limit, are resampled uniformly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description import Curves, MatrixInstances, Mesh, Placed, Placement, PointMotion, Prototype, SceneDescription, Shape
from ..description.motion import is_uniform, segment_of
from ..description.placement import IDENTITY, texts

Times = tuple[float, ...]
Warnings = list[tuple[str, str, str]]  # code, prim path, message

MOST_SEGMENTS = 128
_RESAMPLED = "Its points are resampled to"
EVEN_TIMES: Doubles = np.linspace(0.0, 1.0, MOST_SEGMENTS + 1)


def with_common_times(d: SceneDescription, shapes: list[Shape], warnings: Warnings) -> SceneDescription:
    """Return the description with one set of times per group. Shapes with new times are replaced in `shapes`; lost detail is
    reported."""
    if not any(_has_motion(shape) for shape in shapes):
        return d
    for k, shape in enumerate(shapes):
        if _has_motion(shape) and len(_motion_times(shape)) > len(EVEN_TIMES):
            assert isinstance(shape, Mesh | Curves)
            assert shape.motion is not None
            shapes[k] = replace(shape, motion=resampled(shape.motion, EVEN_TIMES))
            warnings.append(
                (
                    "motion",
                    shape.path,
                    f"{_RESAMPLED} {MOST_SEGMENTS} even steps of motion, from {len(_motion_times(shape)) - 1}.",
                )
            )
    d = _with_even_world(d, shapes)
    prototypes = list(d.prototypes)
    for k, prototype in enumerate(prototypes):
        prototypes[k] = replace(prototype, shapes=_with_common_times(prototype.shapes, shapes, warnings))
    return replace(d, prototypes=tuple(prototypes))


def _has_motion(shape: Shape) -> bool:
    return isinstance(shape, Mesh | Curves) and shape.motion is not None


def _motion_times(shape: Shape) -> Times:
    assert isinstance(shape, Mesh | Curves)
    assert shape.motion is not None
    return tuple(shape.motion.times.tolist())


def _with_even_world(d: SceneDescription, shapes: Sequence[Shape]) -> SceneDescription:
    points: dict[Times, int] = {}
    for placed in d.static:
        if _has_motion(shape := shapes[placed.shape]):
            points[_motion_times(shape)] = points.get(_motion_times(shape), 0) + len(shape.motion.points[0])  # type: ignore[union-attr]
    staying = max((times for times in points if is_uniform(times)), key=lambda times: points[times], default=())
    if set(points) <= {staying}:
        return d
    prototypes, placements, static = list(d.prototypes), list(d.placements), list[Placed]()
    apart: dict[Times, list[Placed]] = {}
    for placed in d.static:
        if _has_motion(shape := shapes[placed.shape]) and _motion_times(shape) != staying:
            apart.setdefault(_motion_times(shape), []).append(placed)
        else:
            static.append(placed)
    for members in apart.values():
        for alone in ([placed] for placed in members if placed.instance) if members[0].instance else [members]:
            names = texts([alone[0].instance]) if alone[0].instance else None
            placements.append(Placement(len(prototypes), (MatrixInstances(IDENTITY[None], names=names),)))
            prototypes.append(Prototype(shapes[alone[0].shape].path, tuple(replace(p, instance="") for p in alone)))
    return replace(d, static=tuple(static), prototypes=tuple(prototypes), placements=tuple(placements))


def _with_common_times(placed: tuple[Placed, ...], shapes: list[Shape], warnings: Warnings) -> tuple[Placed, ...]:
    moving = [p for p in placed if _has_motion(shapes[p.shape])]
    clocks = {_motion_times(shapes[p.shape]) for p in moving}
    if len(clocks) < 2:
        return placed
    times = np.array(sorted(set().union(*clocks)), np.float64)
    times = times[np.append(np.diff(times.astype(np.float32)) > 0, True)]  # distinct in single precision, as in the core
    if len(times) > len(EVEN_TIMES):
        message = f"{_RESAMPLED} {MOST_SEGMENTS} even steps of motion, from {len(times) - 1} of all shapes placed with it."
        warnings.append(("motion", shapes[moving[0].shape].path, message))
        times = EVEN_TIMES
    replaced: dict[int, int] = {}
    for p in moving:
        shape = shapes[p.shape]
        if p.shape not in replaced and isinstance(shape, Mesh | Curves) and shape.motion is not None:
            replaced[p.shape] = len(shapes)
            shapes.append(replace(shape, motion=resampled(shape.motion, times)))
    return tuple(replace(p, shape=replaced.get(p.shape, p.shape)) for p in placed)


def resampled(motion: PointMotion, times: Doubles) -> PointMotion:
    """Return the motion at other times, which include all of its own."""

    def values(steps: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        found = []
        for time in times.tolist():
            k, within = segment_of(motion.times, time)
            found.append(steps[k] * np.float32(1 - within) + steps[k + 1] * np.float32(within))
        return np.stack(found)

    return PointMotion(times, values(motion.points), None if motion.normals is None else values(motion.normals))
