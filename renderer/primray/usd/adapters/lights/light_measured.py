"""A light that is to give so many lumens or lux: its emission scaled to that, now or once its image has been read."""

from __future__ import annotations

from dataclasses import replace

from ....description import Light
from ....description.lighting import Photometric
from ....photometry.scaled import BRIGHTEST, DARK, TOO_BRIGHT, given, scaled, within
from ...resolving.context import Context
from ...resolving.resolve import ResolvedPrim


def measured(prim: ResolvedPrim, light: Light, wanted: Photometric, ctx: Context) -> Light:
    """As much as is wanted; dark, and noted, where the light's emission cannot be scaled to that."""
    if not any(light.emission):
        ctx.warn("light-dark", prim.path, "Its colour, intensity or exposure leaves it no light that could be scaled.")
        return light
    if wanted.amount == 0:
        ctx.warn("light-dark", prim.path, "It is to give 0 lumens or lux.")
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
