"""When a camera's shutter opens and closes, in time codes from the frame on (UsdGeomCamera)."""

from __future__ import annotations

from pxr import Usd

from ....diagnostics import Diagnostics
from ...resolving.read import When, number

INSTANT = (0.0, 0.0)


def read_shutter(prim: Usd.Prim, when: When, disabled: bool, diagnostics: Diagnostics) -> tuple[float, float] | None:
    """None where it closes before it opens: there is no exposure then. `disabled`: without motion blur, so an instant."""
    if disabled:
        return INSTANT
    opens = number(prim, "shutter:open", when, 0.0, diagnostics)
    closes = number(prim, "shutter:close", when, 0.0, diagnostics)
    if closes < opens:
        message = f"The shutter closes at {closes:g}, before it opens at {opens:g}: the picture is black."
        diagnostics.add("camera-input", str(prim.GetPath()), message, "shutter:close")
        return None
    return opens, closes
