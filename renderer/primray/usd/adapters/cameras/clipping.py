"""Clipping of a camera: near and far distance, and additional planes (UsdGeomCamera)."""

from __future__ import annotations

import math
from typing import Any

from pxr import Usd

from ....diagnostics import Diagnostics
from ...stage.values import When, read, vector

Plane = tuple[float, float, float, float]
UNCLIPPED = (0.0, 3e38)


def clipping_range(prim: Usd.Prim, when: When, orthographic: bool, diagnostics: Diagnostics) -> tuple[float, float]:
    """Return the near and far distance in scene units; UNCLIPPED, with a diagnostic, if they are invalid."""
    near, far = vector(prim, "clippingRange", when, (1.0, 1e6), diagnostics)
    if near < far and (near >= 0 or orthographic):
        return (near, far)
    message = f"clippingRange = ({near:g}, {far:g}) is ignored: nothing is clipped."
    diagnostics.add("camera-input", str(prim.GetPath()), message, "clippingRange")
    return UNCLIPPED


def clipping_planes(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> tuple[Plane, ...]:
    """Return planes (a, b, c, d) in camera space; points with a x + b y + c z + d < 0 are clipped."""
    raw = read(prim, "clippingPlanes", when)
    if raw is None:
        return ()
    try:
        planes = [_plane(row) for row in raw]
    except TypeError:
        planes = [None]
    bad = planes.count(None)
    if bad:
        message = f"{bad} of {len(planes)} clippingPlanes are not four finite numbers and are ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "clippingPlanes")
    return tuple(plane for plane in planes if plane is not None)


def _plane(row: Any) -> Plane | None:
    try:
        a, b, c, d = (float(x) for x in row)
    except (TypeError, ValueError):
        return None
    return (a, b, c, d) if all(map(math.isfinite, (a, b, c, d))) else None
