"""Shutter of a camera: when it opens and closes, in time codes relative to the frame (UsdGeomCamera)."""

from __future__ import annotations

from pxr import Usd

from ....diagnostics import Diagnostics
from ...stage.values import When, number

INSTANT = (0.0, 0.0)
Shutter = tuple[float, float] | None  # None: it closes before it opens, so that there is no exposure


def read_shutter(prim: Usd.Prim, when: When, diagnostics: Diagnostics, *, is_instant: bool = False) -> Shutter:
    """Return when the shutter opens and closes; with `is_instant` it closes when it opens, whatever is authored."""
    opens = number(prim, "shutter:open", when, 0.0, diagnostics)
    closes = opens if is_instant else number(prim, "shutter:close", when, 0.0, diagnostics)
    if closes < opens:
        message = f"The shutter closes at {closes:g}, before it opens at {opens:g}: the picture is black."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "shutter:close")
        return None
    return opens, closes
