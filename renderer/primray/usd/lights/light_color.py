"""A light's colour inputs in the rendering space."""

from __future__ import annotations

from ..resolving.color_spaces import color_in_rendering_space
from ..resolving.context import Context
from ..resolving.read import vector
from ..resolving.resolve import ResolvedPrim

Color = tuple[float, float, float]


def light_color(prim: ResolvedPrim, name: str, default: Color, ctx: Context) -> Color:
    """Return a colour input in the rendering space.

    Without an authored space (ColorSpaceAPI) a colour is linear Rec.709, except inputs:color, which is "in the rendering
    color space" (LightAPI).
    """
    if name not in prim.names:
        return default
    r, g, b = vector(prim.prim, name, ctx.when, default, ctx.diagnostics)
    attribute = prim.prim.GetAttribute(name)
    return color_in_rendering_space((r, g, b), attribute, prim.inherited.colors, ctx, assumed=name != "inputs:color")
