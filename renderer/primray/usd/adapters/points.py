"""UsdGeomPoints as exact spheres: one sphere of radius 1, placed at every point with half its width as its scale."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom

from ...description import Doubles, Shape, Sphere
from ..context import Context
from ..notes import note_velocities
from ..read import array, read, value
from ..resolve import ResolvedPrim
from .surface import appearance_of, is_hidden, surface_of

POINT = "Points: sphere"  # the adapter table's name for one of them
DEFAULT_WIDTH = 1.0  # Hydra's, where none is authored
MAX_COLORS = 64  # each is a prototype of its own; more are rounded to COLOR_STEPS a channel
COLOR_STEPS = 4

Color = tuple[float, float, float]


def point_sphere(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    appearance = appearance_of(prim, prim.material, ctx)
    return None if is_hidden(appearance) else Sphere(prim.path, 1.0, surface_of(appearance, lambda: True, ctx))


def spheres(prim: ResolvedPrim, ctx: Context) -> list[tuple[Color | None, Doubles]]:
    """(K, 3, 4) prim_from_sphere by colour; None: of the colour that the prim inherits."""
    points = array(read(prim.prim, "points", ctx.when), 3, "f")
    if points is None or len(points) == 0:
        if points is None:
            ctx.warn("invalid-mesh", prim.path, "points: missing, or of the wrong type.")
        return []
    note_velocities(prim, "points", ctx)
    widths = _widths(prim, len(points), ctx)
    usable = np.isfinite(points).all(axis=1) & np.isfinite(widths) & (widths > 0)
    if not usable.all():
        ctx.warn("invalid-primvar", prim.path, f"{int((~usable).sum())} of {len(points)} points have no place or no width.")
    ctx.warn("points", prim.path, f"{int(usable.sum())} points are rendered as spheres.")
    matrices = np.zeros((len(points), 3, 4))
    matrices[:, [0, 1, 2], [0, 1, 2]] = widths[:, None] / 2
    matrices[:, :, 3] = points
    colors = _colors(prim, len(points), ctx)
    if colors is None:
        return [(None, matrices[usable])]
    distinct, of_point = np.unique(colors[usable], axis=0, return_inverse=True)
    made = matrices[usable]
    return [((r, g, b), made[of_point.reshape(-1) == k]) for k, (r, g, b) in enumerate(distinct.tolist())]


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
        ctx.warn("invalid-primvar", prim.path, f"{name} does not fit {count} points: a width of {DEFAULT_WIDTH:g} is used.")
        return np.full(count, DEFAULT_WIDTH)
    return widths


def _colors(prim: ResolvedPrim, count: int, ctx: Context) -> npt.NDArray[np.floating] | None:
    """displayColor of every point, where it varies."""
    if "primvars:displayColor" not in prim.names:
        return None
    primvar = UsdGeom.Primvar(prim.prim.GetAttribute("primvars:displayColor"))
    if primvar.GetInterpolation() in (UsdGeom.Tokens.constant, UsdGeom.Tokens.uniform):
        return None
    colors = array(value(primvar.GetAttr(), ctx.when), 3, "f")
    if colors is not None and primvar.IsIndexed():
        indices = array(value(primvar.GetIndicesAttr(), ctx.when), 1, "i")
        in_range = indices is not None and len(indices) > 0 and indices.min() >= 0 and indices.max() < len(colors)
        colors = colors[indices] if in_range else None
    if colors is None or len(colors) != count or not np.isfinite(colors).all():
        ctx.warn("invalid-primvar", prim.path, f"primvars:displayColor does not fit {count} points: it is ignored.")
        return None
    if len(np.unique(colors, axis=0)) > MAX_COLORS:
        ctx.warn("instance-primvar", prim.path, f"More than {MAX_COLORS} colours: they are rounded to 1/{COLOR_STEPS}.")
        colors = np.round(colors * COLOR_STEPS) / COLOR_STEPS
    return colors
