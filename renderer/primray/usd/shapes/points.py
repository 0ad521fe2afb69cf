"""Adapter from UsdGeomPoints to exact spheres: one unit sphere, instanced at each point and scaled by half its width."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import MatrixInstances, Shape, Sphere
from ...description.placement import Names
from ..curves.values import read_widths
from ..materials.appearance import appearance_of, is_cut_out, make_surface, undisplaced
from ..motion.attributes import ArrayPath, is_animated
from ..motion.levels import moving_level
from ..motion.points import PointPath, point_path, sampled_point_path
from ..primvars.surface_primvars import constant_primvars, instance_primvars
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import array, read

POINT = "Points: sphere"  # name of the sphere's adapter in the table of adapters
DEFAULT_WIDTH = 1.0  # Hydra's, if none is authored


def point_sphere(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    appearance = appearance_of(prim, prim.material, ctx)
    if is_cut_out(appearance):
        return None
    surface = undisplaced(make_surface(appearance, lambda: True, prim.path, ctx), prim.path, ctx)
    return Sphere(prim.path, 1.0, ctx.surfaces.index_of(surface), constant_primvars(prim, (surface,), ctx))


def sphere_instances(prim: ResolvedPrim, ctx: Context) -> MatrixInstances:
    """Return the instances (prim_from_sphere) of the points, with primvars that vary over points as instance primvars."""
    points = array(read(prim.prim, "points", ctx.when), 3, "f")
    if points is None or len(points) == 0:
        if points is None:
            ctx.warn("invalid-mesh", prim.path, "points: missing, or of the wrong type.", "points")
        return MatrixInstances(np.zeros((0, 3, 4)))
    path = point_path(prim, "points", ctx)
    points = points if path is None else path.at(0.0)
    widths = _point_widths(prim, len(points), ctx)
    usable = np.isfinite(points).all(axis=1) & np.isfinite(widths) & (widths > 0)
    if not usable.all():
        ctx.warn(
            "invalid-primvar",
            prim.path,
            f"{int((~usable).sum())} of {len(points)} points are left out: they have no finite position or no positive width.",
        )
    ctx.warn("points", prim.path, f"{int(usable.sum())} points are rendered as spheres.")
    names = Names(prim.path, numbers=np.arange(len(points), dtype=np.int32)) if ctx.names_instances else None
    placed = MatrixInstances(_sphere_matrices(points, widths), instance_primvars(prim, len(points), ctx), names)
    widening = None if ctx.timing.is_frame else _width_path(prim, len(points), ctx)
    if ctx.timing.is_frame or (path is None and widening is None):
        return placed.take(usable)

    def rows_at(offset: float) -> Doubles:
        return _sphere_matrices(
            points if path is None else path.at(offset), widths if widening is None else widening.at(offset)
        )

    times = {time for moving in (path, widening) if moving is not None for time in moving.times}
    return moving_level(rows_at, sorted(times), placed).take(usable)


def _sphere_matrices(points: npt.NDArray[Any], widths: npt.NDArray[np.floating]) -> Doubles:
    """Return matrices (K, 3, 4) that scale the unit sphere by half the width and move it to the point."""
    matrices = np.zeros((len(points), 3, 4))
    matrices[:, [0, 1, 2], [0, 1, 2]] = widths[:, None] / 2
    matrices[:, :, 3] = points
    return matrices


def _width_path(prim: ResolvedPrim, count: int, ctx: Context) -> PointPath | None:
    """Return the motion of widths that change over the shutter, one value per point; None if they do not change."""
    name = _widths_attribute(prim)
    path = ArrayPath(prim.prim.GetAttribute(name), 1, ctx.when)
    if not is_animated(path.attribute, ctx.when, ctx.timing):
        return None
    found = sampled_point_path(prim, path, ctx)
    here = path.at(0.0)
    if found is None or here is None or len(here) not in (1, count):
        return None
    return PointPath(lambda offset: np.maximum(np.broadcast_to(found.at(offset), count), 0.0), found.times)


def _widths_attribute(prim: ResolvedPrim) -> str:
    """Return the name of the attribute with the widths: primvars:widths takes precedence over widths."""
    return "primvars:widths" if "primvars:widths" in prim.names else "widths"


def _point_widths(prim: ResolvedPrim, count: int, ctx: Context) -> npt.NDArray[np.floating]:
    """Return the width of every point (N,)."""
    name, authored = _widths_attribute(prim), read_widths(prim, ctx.when)
    if read(prim.prim, name, ctx.when) is None:
        return np.full(count, DEFAULT_WIDTH)
    widths = np.zeros(0) if authored is None else authored.values[:, 0]
    if authored is not None and len(widths) == count > 1 and authored.interpolation == "constant":
        message = f"{name} (constant) has one value for each point: it is read as vertex."
        ctx.warn("invalid-primvar", prim.path, message, name)
    if len(widths) == 1:
        return np.full(count, widths[0])
    if len(widths) != count:
        ctx.warn(
            "invalid-primvar", prim.path, f"{name} does not fit {count} points: a width of {DEFAULT_WIDTH:g} is used.", name
        )
        return np.full(count, DEFAULT_WIDTH)
    return widths
