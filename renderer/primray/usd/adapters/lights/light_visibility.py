"""Visibility of a light to camera rays.

UsdLux has no attribute for it, so the attributes of other renderers are read. Lights are visible by default, as in hdEmbree's
reference implementation and in UsdLux's text ("a directly visible light").
"""

from __future__ import annotations

from ...resolving.context import Context
from ...resolving.read import read
from ...resolving.renderer_attributes import CAMERA_VISIBILITY
from ...resolving.resolve import ResolvedPrim

_ATTRIBUTES = frozenset(CAMERA_VISIBILITY)


def is_seen_by_camera(prim: ResolvedPrim, ctx: Context) -> bool:
    """Return whether camera rays see the light; the first authored attribute of CAMERA_VISIBILITY decides."""
    if _ATTRIBUTES.isdisjoint(prim.names):
        return True
    found: list[tuple[str, bool]] = []
    for name in CAMERA_VISIBILITY:
        if name not in prim.names:
            continue
        raw = read(prim.prim, name, ctx.when)
        if not isinstance(raw, bool | int | float):
            ctx.warn("wrong-type", prim.path, f"{name} = {raw!r} is neither a bool nor a number: it is ignored.", name)
            continue
        if 0 < raw < 1:
            ctx.warn("light-input", prim.path, f"{name} = {raw:g} is a partial weight: the camera sees the whole light.", name)
        found.append((name, bool(raw > 0)))
    if not found:
        return True
    decides, seen = found[0]
    for name, other in found[1:]:
        if other != seen:
            ctx.warn("light-input", prim.path, f"{name} is ignored: {decides} has another value and comes first.", name)
    return seen
