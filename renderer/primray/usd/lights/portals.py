"""Portals: the rectangles that a dome's `portals` relationship names, where they stand in the world (UsdLux PortalLight)."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Usd, UsdGeom

from ...arrays import Doubles
from ...description import Portal
from ..querying.guarded import property_names, targets, type_name
from ..resolving.context import Context
from ..resolving.convert import matrix
from ..resolving.notes import PortalsMet
from ..resolving.read import number
from ..resolving.resolve import ResolvedPrim, local_matrix


class _Named(set[str]):
    """Paths of PortalLights that a dome names."""


def portals_of(dome: ResolvedPrim, world_from_dome: Doubles, ctx: Context) -> tuple[Portal, ...]:
    """Those that the dome names and that have an area; invisible ones too, for they change no picture."""
    found = []
    for target in targets(dome.prim, "portals"):
        prim = ctx.stage.GetPrimAtPath(target)
        if not prim or type_name(prim) != "PortalLight":
            what = f"a {type_name(prim) or 'prim without a type'}" if prim else "nothing"
            message = f"portals leads to {ctx.shown(str(target))}, which is {what}, no PortalLight: ignored."
            ctx.warn("light-input", dome.path, message, "portals")
            continue
        ctx.kept.of(_Named).add(ctx.shown(str(prim.GetPath())))
        portal = _portal(dome, world_from_dome, prim, ctx)
        if portal is not None:
            found.append(portal)
    return tuple(found)


def _portal(dome: ResolvedPrim, world_from_dome: Doubles, prim: Usd.Prim, ctx: Context) -> Portal | None:
    path = ctx.shown(str(prim.GetPath()))
    width = abs(number(prim, "inputs:width", ctx.when, 1.0, ctx.diagnostics))
    height = abs(number(prim, "inputs:height", ctx.when, 1.0, ctx.diagnostics))
    world = _root_from_prim(prim, ctx)
    if dome.prim.IsInPrototype() and prim.IsInPrototype():  # both stand where the instance does
        root_from_dome = _root_from_prim(dome.prim, ctx)
        if abs(np.linalg.det(root_from_dome[:3, :3])) > 0:
            world = world_from_dome @ np.linalg.inv(root_from_dome) @ world
    area = width * height * float(np.linalg.norm(np.cross(world[:3, 0], world[:3, 1])))
    if not np.isfinite(world).all() or not np.isfinite(area) or area == 0:
        ctx.warn("light-input", path, "The portal has no area that light could come through: it guides nothing.")
        return None
    return Portal(world, width, height)


def _root_from_prim(prim: Usd.Prim, ctx: Context) -> Doubles:
    cache = UsdGeom.XformCache(ctx.when.time)
    total = Gf.Matrix4d(1.0)
    while prim and not prim.IsPseudoRoot() and not prim.IsPrototype():
        local, resets = local_matrix(prim, frozenset(property_names(prim)), ctx.when, cache)
        total = total * local
        if resets:
            break
        prim = prim.GetParent()
    return matrix(total)


def note_unnamed_portals(ctx: Context) -> None:
    """After all lights."""
    named = ctx.kept.of(_Named)
    for path in ctx.kept.of(PortalsMet):
        if path not in named:
            ctx.warn("light-input", path, "No dome's `portals` names this PortalLight: it guides nothing.", "portals")
