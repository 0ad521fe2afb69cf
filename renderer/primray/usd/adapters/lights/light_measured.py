"""Lights given in lumens or lux: their emission is scaled to that here or, if they have a texture, once it is read."""

from __future__ import annotations

from dataclasses import replace

from ....description import Light
from ....description.lighting import Photometric
from ....photometry.scaled import BRIGHTEST, DARK, TOO_BRIGHT, given, scaled, within
from ...resolving.context import Context
from ...resolving.resolve import ResolvedPrim


def measured(prim: ResolvedPrim, light: Light, wanted: Photometric, ctx: Context) -> Light:
    """Return the light scaled to the wanted amount; dark, with a diagnostic, if no scale gives it."""
    if not any(light.emission):
        ctx.warn(
            "light-dark",
            prim.path,
            "The light's colour, intensity or exposure makes its emission 0, which cannot be scaled to the requested amount.",
        )
        return light
    if wanted.amount == 0:
        ctx.warn("light-dark", prim.path, "The requested amount is 0 lumens or lux: the light emits nothing.")
        return replace(light, emission=(0.0, 0.0, 0.0))
    if light.texture is not None:
        return replace(light, photometric=wanted)
    found = scaled(light, wanted, given(light, wanted))
    if found is None:
        ctx.warn("light-dark", prim.path, DARK)
        return replace(light, emission=(0.0, 0.0, 0.0))
    if max(found.emission) > BRIGHTEST:
        ctx.warn("out-of-range", prim.path, TOO_BRIGHT)
    return within(found)
