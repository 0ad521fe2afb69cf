"""Motion of a mesh's points and authored normals over the shutter; its topology is that of the frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Floats
from ...description import PointMotion
from ..motion.attributes import bend_times, is_animated
from ..motion.points import PointPath, point_path, point_steps
from ..motion.sample_times import fractions
from ..primvars.reading import AuthoredPrimvar
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from .authored import AuthoredMesh, read_normals
from .polygons import PolygonMotion, Polygons, Values, normals_of
from .triangulate import LARGEST

if TYPE_CHECKING:
    from .subdivision import Cage


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshPath:
    """Motion of a shape's points. Offsets from the frame include motion:blurScale."""

    prim: ResolvedPrim
    points: PointPath | None
    normals: Callable[[float], AuthoredPrimvar | None] | None  # None if they do not change
    times: tuple[float, ...]
    here: float  # offset of the frame, or of the instant of a still
    blur_scale: float


def mesh_path(prim: ResolvedPrim, authored: AuthoredMesh, ctx: Context) -> MeshPath | None:
    """Return the mesh's motion, or None if it does not move."""
    return path_of_points(prim, ctx, has_normals=authored.normals is not None)


def path_of_points(prim: ResolvedPrim, ctx: Context, *, has_normals: bool = False) -> MeshPath | None:
    """Return the motion of any shape that has points, or None if it does not move."""
    points = point_path(prim, "points", ctx)
    names = ("normals", "primvars:normals") if has_normals and ctx.timing.is_timed and not ctx.timing.is_frame else ()
    attributes = [prim.prim.GetAttribute(name) for name in names if name in prim.names]
    turning = [attribute for attribute in attributes if is_animated(attribute, ctx.when, ctx.timing)]
    if points is None and not turning:
        return None
    scale = prim.inherited.blur_scale
    times = {*(points.times if points else ()), *bend_times(turning, ctx.when, ctx.timing)}
    normals = (lambda offset: read_normals(prim, ctx.when.after(offset))) if turning else None
    here = 0.0 if ctx.timing.is_open else scale * ctx.timing.opens
    return MeshPath(prim=prim, points=points, normals=normals, times=tuple(sorted(times)), here=here, blur_scale=scale)


def with_points(authored: AuthoredMesh, path: MeshPath, offset: float) -> AuthoredMesh:
    """Return the mesh at an offset from the frame."""
    points, normals = authored.points, authored.normals
    if path.points is not None:
        points = path.points.at(offset).astype(np.float32)
    if path.normals is not None:
        found = path.normals(offset)
        fits = found is not None and normals is not None and _value_count(found) == _value_count(normals)
        normals = found if fits else normals
    return replace(authored, points=points, normals=normals)


def _value_count(normals: AuthoredPrimvar) -> int:
    return len(normals.values) if hasattr(normals.values, "__len__") else 0


def moving_polygons(polygons: Polygons, authored: AuthoredMesh, path: MeshPath, ctx: Context) -> Polygons:
    """Return the polygons with their motion, if they move while the shutter is open."""
    if not ctx.timing.is_open:
        return polygons
    known: dict[float, tuple[Floats, Values | None]] = {}

    def at(fraction: float) -> tuple[Floats, Values | None]:
        if fraction not in known:
            then = with_points(authored, path, path.blur_scale * ctx.timing.offset(fraction))
            points = finite_points(then.points, polygons.points)
            known[fraction] = points, normals_of(then, points, polygons.triangles, polygons.sizes, ctx)
        return known[fraction]

    times = _sample_times(lambda fraction: _points_and_normals(*at(fraction)), len(polygons.points), path, ctx)
    if times is None:
        return polygons
    found = [at(time) for time in times]
    normals = [values for _, values in found if values is not None]
    if len(normals) < len(found) or {values.per for values in normals} != {polygons.normals and polygons.normals.per}:
        normals = []
    turning = () if not normals or _all_equal(normals) else tuple(normals)
    motion = PolygonMotion(np.array(times), np.stack([points for points, _ in found]), turning)
    return replace(polygons, motion=motion)


def moving_cage(cage: Cage, path: MeshPath, ctx: Context) -> Cage:
    motion = moving_points(cage.points, path, ctx)
    return cage if motion is None else replace(cage, motion=motion)


def moving_points(frame: Floats, path: MeshPath, ctx: Context) -> PointMotion | None:
    """Return the motion of points (N, 3) given at the frame; None if they do not move while the shutter is open."""
    if not ctx.timing.is_open or path.points is None:
        return None
    points = path.points

    def at(fraction: float) -> Floats:
        return finite_points(points.at(path.blur_scale * ctx.timing.offset(fraction)).astype(np.float32), frame)

    times = _sample_times(at, len(frame), path, ctx)
    return None if times is None else PointMotion(np.array(times), np.stack([at(time) for time in times]))


def finite_points(points: Floats | None, frame: Floats) -> Floats:
    """Return the points with non-finite ones replaced by those at the frame."""
    if points is None:
        return frame
    good = np.abs(points).max(axis=1) <= LARGEST
    return points if good.all() else np.where(good[:, None], points, frame)


def _points_and_normals(points: Floats, normals: Values | None) -> Floats:
    return points if normals is None else np.concatenate([points, normals.array])


def _all_equal(normals: list[Values]) -> bool:
    return all(np.array_equal(values.array, normals[0].array) for values in normals[1:])


def _sample_times(at: Callable[[float], Floats], count: int, path: MeshPath, ctx: Context) -> tuple[float, ...] | None:
    """Return the fractions of the span at which to sample the points; None if they do not move."""
    bent = fractions(path.times, ctx.timing.span, path.blur_scale)
    # Motion is linear between samples, unless there are accelerations.
    curved = path.points is not None and path.points.acceleration > 0
    return point_steps(at, count, bent, path.prim.path, ctx, curved=curved)
