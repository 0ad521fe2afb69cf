"""Which surface a shape gets: its bound material, else its displayColor, else USD's fallback grey."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pxr import Usd, UsdGeom

from ...description import Surface
from ..context import Context
from ..read import array, read
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
    if prim.inherited.color is None:
        if "primvars:displayColor" in prim.names and not _is_empty(prim, ctx):
            ctx.warn("invalid-primvar", prim.path, "primvars:displayColor is not a usable colour: the fallback grey is used.")
        return FALLBACK_COLOR
    return prim.inherited.color


def _is_empty(prim: ResolvedPrim, ctx: Context) -> bool:
    raw = read(prim.prim, "primvars:displayColor", ctx.when)
    return raw is None or (hasattr(raw, "__len__") and len(raw) == 0)


def _note_opacity(prim: ResolvedPrim, ctx: Context) -> None:
    least = prim.inherited.opacity
    if "primvars:displayOpacity" in prim.names:
        values = array(read(prim.prim, "primvars:displayOpacity", ctx.when), 1, "f")
        least = float(values.min()) if values is not None and len(values) else least
    if least is not None and least < 1:
        ctx.warn("display-opacity", prim.path, f"primvars:displayOpacity is {least:g} at its least.")
