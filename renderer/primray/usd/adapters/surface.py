"""Which surface a shape gets: its bound material, else its displayColor, else USD's fallback grey."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pxr import Usd, UsdGeom

from ...description import Surface
from ..context import Context
from ..read import array, value
from ..resolve import ResolvedPrim
from .material import Material, material

# UsdGeomGprim's displayColor has no fallback; 0.18 is UsdPreviewSurface's diffuseColor and what Storm draws.
FALLBACK_COLOR = (0.18, 0.18, 0.18)


@dataclass(frozen=True)
class Appearance:
    """Either a material, or a colour: constant, or varying over the mesh (and then the surface is white)."""

    material: Material | None
    color: tuple[float, float, float] = FALLBACK_COLOR
    varying_color: bool = False


def appearance_of(prim: ResolvedPrim, bound: Usd.Prim | None, ctx: Context) -> Appearance:
    made = material(bound, ctx) if bound is not None else None
    if made is not None and made.surface is not None:
        return Appearance(made)
    attribute = prim.prim.GetAttribute("primvars:displayColor") if "primvars:displayColor" in prim.names else None
    if attribute and attribute.HasAuthoredValue() and UsdGeom.Primvar(attribute).GetInterpolation() != "constant":
        appearance = Appearance(None, (1.0, 1.0, 1.0), varying_color=True)
    else:
        appearance = Appearance(None, _constant_color(prim, ctx))
    _note_opacity(prim, ctx)
    return appearance


def surface_of(appearance: Appearance, is_closed: Callable[[], bool], ctx: Context) -> int:
    """The index of the appearance's surface; `is_closed` is asked only where something shines through."""
    if appearance.material is None or appearance.material.surface is None:
        return ctx.surface_index(Surface(path="", lambert=True, diffuse_color=appearance.color))
    surface = appearance.material.surface
    if surface.opacity < 1:
        surface = replace(surface, thin=surface.ior == 1 or not is_closed())
    return ctx.surface_index(surface)


def is_hidden(appearance: Appearance) -> bool:
    return appearance.material is not None and appearance.material.hidden


def _constant_color(prim: ResolvedPrim, ctx: Context) -> tuple[float, float, float]:
    attribute = prim.inherited.color
    if attribute is None:
        return FALLBACK_COLOR
    raw = value(attribute, ctx.when)
    indices = value(UsdGeom.Primvar(attribute).GetIndicesAttr(), ctx.when)
    colors = array(raw, 3, "f")
    if colors is None or len(colors) == 0:
        if raw is not None and (colors is None or indices):
            ctx.warn("invalid-primvar", str(attribute.GetPrim().GetPath()), "primvars:displayColor is not an array of colours.")
        return FALLBACK_COLOR
    at = int(indices[0]) if indices else 0
    if not 0 <= at < len(colors):
        ctx.warn("invalid-primvar", str(attribute.GetPrim().GetPath()), "primvars:displayColor has indices outside its values.")
        return FALLBACK_COLOR
    r, g, b = colors[at].tolist()
    return (r, g, b)


def _note_opacity(prim: ResolvedPrim, ctx: Context) -> None:
    attribute = prim.inherited.opacity
    if "primvars:displayOpacity" in prim.names:
        attribute = prim.prim.GetAttribute("primvars:displayOpacity")
    if attribute is None:
        return
    opacity = array(value(attribute, ctx.when), 1, "f")
    if opacity is not None and len(opacity) and float(opacity.min()) < 1:
        ctx.warn("display-opacity", prim.path, f"primvars:displayOpacity is {float(opacity.min()):g} at its least.")
