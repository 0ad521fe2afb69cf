"""UsdGeomPoints as exact spheres: one sphere of radius 1, placed at every point with half its width as its scale."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ....description import MatrixInstances, Shape, Sphere
from ....description.instance_names import Names
from ...resolving.context import Context
from ...resolving.notes import note_velocities
from ...resolving.read import array, read
from ...resolving.resolve import ResolvedPrim
from ...shapes.instance_primvars import instance_primvars
from ...shapes.surface_primvars import constant_primvars
from ..materials.surface import appearance_of, is_hidden, make_surface

POINT = "Points: sphere"  # the adapter table's name for one of them
DEFAULT_WIDTH = 1.0  # Hydra's, where none is authored


def point_sphere(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    appearance = appearance_of(prim, prim.material, ctx)
    if is_hidden(appearance):
        return None
    surface = make_surface(appearance, lambda: True)
    return Sphere(prim.path, 1.0, ctx.surfaces.index_of(surface), constant_primvars(prim, (surface,), ctx))


def spheres(prim: ResolvedPrim, ctx: Context) -> MatrixInstances:
    """prim_from_sphere of each, and what varies over the points, as an instancer's instances have it."""
    points = array(read(prim.prim, "points", ctx.when), 3, "f")
    if points is None or len(points) == 0:
        if points is None:
            ctx.warn("invalid-mesh", prim.path, "points: missing, or of the wrong type.", "points")
        return MatrixInstances(np.zeros((0, 3, 4)))
    note_velocities(prim, "points", ctx)
    widths = _widths(prim, len(points), ctx)
    usable = np.isfinite(points).all(axis=1) & np.isfinite(widths) & (widths > 0)
    if not usable.all():
        ctx.warn("invalid-primvar", prim.path, f"{int((~usable).sum())} of {len(points)} points have no place or no width.")
    ctx.warn("points", prim.path, f"{int(usable.sum())} points are rendered as spheres.")
    matrices = np.zeros((len(points), 3, 4))
    matrices[:, [0, 1, 2], [0, 1, 2]] = widths[:, None] / 2
    matrices[:, :, 3] = points
    names = Names(prim.path, numbers=np.arange(len(points), dtype=np.int32)) if ctx.names_instances else None
    return MatrixInstances(matrices, instance_primvars(prim, len(points), ctx), names).take(usable)


def _widths(prim: ResolvedPrim, count: int, ctx: Context) -> npt.NDArray[np.floating]:
    """Of every point; primvars:widths is stronger than widths."""
    name = "primvars:widths" if "primvars:widths" in prim.names else "widths"
    raw = read(prim.prim, name, ctx.when)
    if raw is None:
        return np.full(count, DEFAULT_WIDTH)
    widths = array(raw, 1, "f")
    if widths is not None and len(widths) == 1:
        return np.full(count, widths[0])
    if widths is None or len(widths) != count:
        ctx.warn(
            "invalid-primvar", prim.path, f"{name} does not fit {count} points: a width of {DEFAULT_WIDTH:g} is used.", name
        )
        return np.full(count, DEFAULT_WIDTH)
    return widths
