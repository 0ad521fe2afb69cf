"""Adapter from UsdGeomNurbsPatch to a NurbsPatch, which is diced for the camera's view (tessellation/nurbs). Authored normals
are ignored.

Primvars are laid out as in RenderMan's NuPatch, which the schema follows: uniform ones have a value per knot segment, varying
and faceVarying ones per crossing of knots, vertex ones per control point. Unless authored, the texture coordinates `st` are the
parameters, from 0 to 1 over the drawn range.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ...description import Direction, Interpolation, NurbsPatch, Surface
from ...description import Primvar as SeamPrimvar
from ...tessellation.nurbs.patches import coarse_mesh
from ..materials.appearance import FALLBACK_COLOR, appearance_of, is_cut_out, make_surface, undisplaced
from ..mesh.closed import is_closed, report_inside_out
from ..mesh.motion import moving_points, path_of_points
from ..primvars.reading import Primvar, Sizes, read_display_color
from ..primvars.surface_primvars import TANGENT_ST, read_primvars
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from .patches import AuthoredPatch, read_patch

INTERPOLATIONS = {
    "constant": Interpolation.CONSTANT,
    "uniform": Interpolation.FACE,
    "vertex": Interpolation.POINT,
    "varying": Interpolation.VARYING,
    "faceVarying": Interpolation.VARYING,
}


def nurbs_patch(prim: ResolvedPrim, ctx: Context) -> NurbsPatch | None:
    authored = read_patch(prim, ctx)
    appearance = appearance_of(prim, prim.material, ctx)
    if authored is None or is_cut_out(appearance):
        return None
    path = path_of_points(prim, ctx)
    points = authored.points
    if path is not None and path.points is not None:
        points = path.points.at(path.here).astype(np.float32)
    sizes = _sizes(authored)
    color = read_display_color(sizes, prim, ctx) if appearance.varying_color else None
    if color is not None and color.values.shape[1] != 3:
        color = None
    if appearance.varying_color and color is None:
        appearance = replace(appearance, color=FALLBACK_COLOR)
    made = NurbsPatch(
        path=prim.path,
        points=points,
        weights=authored.weights,
        u=authored.u,
        v=authored.v,
        surface=0,
        loops=authored.loops,
        colors=None if color is None else _described_primvar("displayColor", color),
        is_flipped=authored.is_left_handed,
        motion=None if path is None else moving_points(points, path, ctx),
    )
    surface = undisplaced(
        make_surface(appearance, lambda: _is_closed_patch(made, prim.path, ctx), prim.path, ctx), prim.path, ctx
    )
    return replace(made, surface=ctx.surfaces.index_of(surface), primvars=_primvars(prim, (surface,), authored, sizes, ctx))


def _sizes(patch: AuthoredPatch) -> Sizes:
    u, v = (d.count - d.order + 1 for d in (patch.u, patch.v))
    crossings = (u + 1) * (v + 1)
    return Sizes(u * v, patch.u.count * patch.v.count, crossings, ends=crossings)


def _is_closed_patch(patch: NurbsPatch, path: str, ctx: Context) -> bool:
    """Return whether the patch is closed, so that light can enter it. Reports patches whose normals point inwards."""
    mesh = coarse_mesh(patch)
    if patch.loops or not is_closed(mesh.points, mesh.triangles):
        return False
    report_inside_out(mesh.points, mesh.triangles, path, ctx)
    return True


def _primvars(
    prim: ResolvedPrim, surfaces: Collection[Surface], patch: AuthoredPatch, sizes: Sizes, ctx: Context
) -> tuple[SeamPrimvar, ...]:
    if not ctx.aov_primvars and not any(surface.inputs for surface in surfaces):
        return ()
    instead = {TANGENT_ST: _parameters(patch)}
    return tuple(_described_primvar(name, found) for name, found in read_primvars(prim, surfaces, sizes, ctx, instead))


def _parameters(patch: AuthoredPatch) -> Primvar:
    """Return the default `st` at the knots' crossings: 0 to 1 over the drawn range, beyond that outside the drawn range."""
    s, t = (_shares(direction) for direction in (patch.u, patch.v))
    st = np.stack(np.broadcast_arrays(s[None, :], t[:, None]), axis=2)
    return Primvar(st.reshape(-1, 2).astype(np.float32), "varying")


def _shares(d: Direction) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray((d.knots[d.order - 1 : d.count + 1] - d.low) / (d.high - d.low))


def _described_primvar(name: str, primvar: Primvar) -> SeamPrimvar:
    return SeamPrimvar(name, INTERPOLATIONS.get(primvar.interpolation, Interpolation.VARYING), primvar.flat())
