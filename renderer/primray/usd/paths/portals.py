"""Moving portals: they move with their parents or alone, and stay in front of the openings that they guide samples to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from pxr import Usd

from ...arrays import Doubles
from ...description import Light, LightType, Portal
from ..lights.portals import PortalPrims, root_from_prim, way_to_root
from ..moving.settle import Precision
from ..querying.guarded import property_names
from ..resolving.context import Context
from .changes import bends, blur_scale_of, moving_operations
from .lights import LightPath, moving_light

WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class PortalPath:
    """A portal's world transform by time offset from the frame."""

    at: Callable[[float], Doubles]  # (4, 4)
    times: tuple[float, ...]  # offsets at which the path may bend
    blur_scale: float


def with_moving_portals(dome: Light, path: LightPath | None, precision: Precision, ctx: Context) -> Light:
    """Return the dome with the motion of its portals; `path` is the dome's own motion, if it moves."""
    return replace(dome, portals=tuple(_moving(portal, path, precision, ctx) for portal in dome.portals))


def _moving(portal: Portal, dome_path: LightPath | None, precision: Precision, ctx: Context) -> Portal:
    known = ctx.kept.of(PortalPrims).get(id(portal))
    if known is None:
        return portal
    path = _path(known.prim, known.dome, known.world_from_dome, dome_path, ctx)
    shape = Light(known.path, LightType.RECT, portal.world_from_portal, WHITE, width=portal.width, height=portal.height)
    return replace(portal, motion=moving_light(shape, path, precision, ctx).motion)


def _path(
    prim: Usd.Prim, dome: Usd.Prim | None, world_from_dome: Doubles, dome_path: LightPath | None, ctx: Context
) -> PortalPath:
    """Return a portal's path. `dome` is given if both are in one prototype, whose placement is known by the dome's."""
    times = _times(prim, ctx)
    if dome is None:
        return PortalPath(lambda offset: root_from_prim(prim, ctx, offset), times, blur_scale_of(prim))
    own = () if dome_path is None else dome_path.times

    def at(offset: float) -> Doubles:
        world = world_from_dome if dome_path is None else dome_path.at(offset)
        return np.asarray(world @ np.linalg.inv(root_from_prim(dome, ctx, offset)) @ root_from_prim(prim, ctx, offset))

    return PortalPath(at, (*times, *own), 1.0 if dome_path is None else dome_path.blur_scale)


def _times(prim: Usd.Prim, ctx: Context) -> tuple[float, ...]:
    found = [
        operation
        for above in way_to_root(prim)
        for operation in moving_operations(above, frozenset(property_names(above)), ctx.when, ctx.timing)
    ]
    return tuple(bends(found, ctx.when, ctx.timing))
