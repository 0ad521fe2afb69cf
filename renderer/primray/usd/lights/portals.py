"""Portals of domes: the rectangles that a dome's `portals` relationship names, in world space (UsdLux PortalLight)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import Gf, Usd

from ...arrays import Doubles
from ...description import Portal
from ..scene.context import Context, PortalPrim
from ..scene.inheritance import ResolvedPrim, local_matrix, transforms
from ..stage.reads import property_names, targets, type_name
from ..stage.values import matrix, number


def read_portals(dome: ResolvedPrim, world_from_dome: Doubles, ctx: Context) -> tuple[Portal, ...]:
    """Return the portals of a dome that have an area; invisible ones too, since portals do not change the expected image."""
    found = []
    for target in targets(dome.prim, "portals"):
        prim = ctx.stage.GetPrimAtPath(target)
        if not prim or type_name(prim) != "PortalLight":
            what = f"a {type_name(prim) or 'prim without a type'}" if prim else "nothing"
            message = f"portals names {ctx.shown(str(target))}, which is {what} and not a PortalLight: it is ignored."
            ctx.warn("light-input", dome.path, message, "portals")
            continue
        ctx.findings.named_portals.add(ctx.shown(str(prim.GetPath())))
        portal = _portal(dome, world_from_dome, prim, ctx)
        if portal is not None:
            found.append(portal)
    return tuple(found)


def _portal(dome: ResolvedPrim, world_from_dome: Doubles, prim: Usd.Prim, ctx: Context) -> Portal | None:
    path = ctx.shown(str(prim.GetPath()))
    width = abs(number(prim, "inputs:width", ctx.when, 1.0, ctx.diagnostics))
    height = abs(number(prim, "inputs:height", ctx.when, 1.0, ctx.diagnostics))
    world, together = world_from_prim(prim, ctx), None
    if dome.prim.IsInPrototype() and prim.IsInPrototype():  # both move with the instance
        root_from_dome = world_from_prim(dome.prim, ctx)
        if abs(np.linalg.det(root_from_dome[:3, :3])) > 0:
            world, together = world_from_dome @ np.linalg.inv(root_from_dome) @ world, dome.prim
    area = width * height * float(np.linalg.norm(np.cross(world[:3, 0], world[:3, 1])))
    if not np.isfinite(world).all() or not np.isfinite(area) or area == 0:
        ctx.warn("light-input", path, "The portal's area is 0: it is ignored.")
        return None
    portal = Portal(world, width, height)
    if ctx.timing.is_open:
        ctx.findings.moving_portals[id(portal)] = PortalPrim(portal, path, prim, together, world_from_dome)
    return portal


def world_from_prim(prim: Usd.Prim, ctx: Context, offset: float = 0.0) -> Doubles:
    """Return world_from_prim (4, 4), or prototype_from_prim, at `offset` time codes after the frame."""
    when = ctx.when.after(offset) if offset else ctx.when
    cache = transforms(when)
    total = Gf.Matrix4d(1.0)
    for each in self_and_ancestors(prim):
        local, resets = local_matrix(each, frozenset(property_names(each)), when, cache)
        total = total * local
        if resets:
            break
    return matrix(total)


def self_and_ancestors(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """Yield the prim and its ancestors, up to the world or the prototype that it is in."""
    while prim and not prim.IsPseudoRoot() and not prim.IsPrototype():
        yield prim
        prim = prim.GetParent()


def report_unnamed_portals(ctx: Context) -> None:
    """Report PortalLights that no dome names; called after all lights are translated."""
    named = ctx.findings.named_portals
    for path in ctx.findings.portals:
        if path not in named:
            ctx.warn("light-input", path, "No dome's `portals` names this PortalLight: it has no effect.", "portals")
