"""Appearance of a shape: its bound material, else displayColor and displayOpacity, else USD's fallback grey.

Without a material, displayOpacity is the presence of a Lambert surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

from pxr import Usd, UsdGeom

from ...description import CameraVisibility, HomogeneousVolume, Input, PrimvarInput, Surface
from ..primvars.reading import report_clamped_color, report_many_values
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim, element_count
from ..scene.schemas import SHAPE_VISIBILITY
from ..stage.reads import interpolation
from ..stage.values import read, token
from .material import translated_material
from .translated_material import Material

# UsdGeomGprim's displayColor has no fallback; 0.18 is UsdPreviewSurface's diffuseColor and Storm's default.
FALLBACK_COLOR = (0.18, 0.18, 0.18)
_COLOR, _OPACITY = "displayColor", "displayOpacity"


@dataclass(frozen=True)
class Appearance:
    """A material, or a colour and an opacity: constant, or varying over the mesh or by instance.

    With `varying_color` the mesh has the colour (and the surface is white); `inputs` are read as primvars.
    """

    material: Material | None
    color: tuple[float, float, float] = FALLBACK_COLOR
    varying_color: bool = False
    opacity: float = 1.0
    inputs: tuple[tuple[str, Input], ...] = ()
    camera: CameraVisibility = CameraVisibility.SEEN


def appearance_of(prim: ResolvedPrim, bound: Usd.Prim | None, ctx: Context) -> Appearance:
    """Return the appearance of a shape that is bound to a material, or to none."""
    found, camera = _appearance_of(prim, bound, ctx), camera_visibility(prim, ctx)
    return found if camera is CameraVisibility.SEEN else replace(found, camera=camera)


def camera_visibility(prim: ResolvedPrim, ctx: Context) -> CameraVisibility:
    """Return how the camera sees a shape, as render_settings/render_pass.py has written it."""
    if SHAPE_VISIBILITY not in prim.names:
        return CameraVisibility.SEEN
    said = token(prim.prim, SHAPE_VISIBILITY, ctx.when, CameraVisibility.SEEN.value)
    try:
        return CameraVisibility(said)
    except ValueError:  # not written by a render pass
        ctx.warn(
            "out-of-range", prim.path, f"{SHAPE_VISIBILITY} = {said!r} is unknown: the camera sees the shape.", SHAPE_VISIBILITY
        )
        return CameraVisibility.SEEN


def _appearance_of(prim: ResolvedPrim, bound: Usd.Prim | None, ctx: Context) -> Appearance:
    made = translated_material(bound, prim.inherited, ctx) if bound is not None else None
    if made is not None and made.surface is not None:
        return Appearance(made)
    inputs: list[tuple[str, Input]] = []
    color, varying_color = FALLBACK_COLOR, False
    if not prim.own_color and _varies(prim, _COLOR):
        color, varying_color = (1.0, 1.0, 1.0), True
    elif prim.inherited.color is None and _COLOR in prim.inherited.per_instance:
        inputs.append(("diffuse_color", PrimvarInput(_COLOR, FALLBACK_COLOR)))
    else:
        color = _constant_color(prim, ctx)
    opacity = 1.0
    if prim.inherited.opacity is not None:
        report_many_values("primvars:displayOpacity", element_count(prim.inherited, "primvars:displayOpacity"), prim.path, ctx)
        opacity = min(max(prim.inherited.opacity, 0.0), 1.0)
    if _varies(prim, _OPACITY) or (prim.inherited.opacity is None and _OPACITY in prim.inherited.per_instance):
        inputs.append(("opacity", PrimvarInput(_OPACITY, (1.0,))))
        opacity = 1.0
    return Appearance(None, color, varying_color, opacity, tuple(inputs))


def _varies(prim: ResolvedPrim, name: str) -> bool:
    """Whether the prim has a primvar of this name with a value for each of its parts."""
    if f"primvars:{name}" not in prim.names:
        return False
    attribute = prim.prim.GetAttribute(f"primvars:{name}")
    return bool(attribute.HasAuthoredValue() and interpolation(UsdGeom.Primvar(attribute)) != "constant")


def make_surface(appearance: Appearance, is_closed: Callable[[], bool], path: str, ctx: Context) -> Surface:
    """Return the appearance's surface on a shape; `is_closed` is called only for surfaces that transmit light."""
    made = _surface_of(appearance, is_closed, path, ctx)
    camera = _matte_visibility(made, path, ctx) if appearance.camera is CameraVisibility.MATTE else appearance.camera
    return made if camera is made.camera else replace(made, camera=camera)


def _matte_visibility(surface: Surface, path: str, ctx: Context) -> CameraVisibility:
    """Return what the camera sees of a matte shape: nothing holds out what lies behind a surface that is not there at all.

    A surface that is there in part holds out as much as a whole one, which is reported. Cut-outs are holes in any case.
    """
    if not surface.presence or surface.opacity_threshold > 0 or surface.volume is not None:
        return CameraVisibility.MATTE
    varies = "opacity" in surface.varying
    if surface.opacity == 0 and not varies:
        return CameraVisibility.HIDDEN
    if surface.opacity < 1 or varies:
        message = "The matte surface is partly transparent (presence), but holds out everything behind it."
        ctx.warn("render-settings-input", path, message, "collection:matte")
    return CameraVisibility.MATTE


def _surface_of(appearance: Appearance, is_closed: Callable[[], bool], path: str, ctx: Context) -> Surface:
    if appearance.material is None or appearance.material.surface is None:
        return _display_surface(appearance)
    surface = appearance.material.surface
    if surface.volume is not None:
        return _filled_surface(surface, surface.volume, is_closed, path, ctx)
    if surface.transmits and not (surface.thin or surface.bends_nothing) and not is_closed():
        if surface.open_pbr is not None and surface.open_pbr.transmission_depth > 0:
            ctx.warn("open-interior", path, f"{surface.path} has an interior, but the mesh is not closed: it is thin-walled.")
        return replace(surface, thin=True)
    return replace(surface, thin=True) if surface.transmits and surface.bends_nothing else surface


def _filled_surface(
    surface: Surface, volume: HomogeneousVolume, is_closed: Callable[[], bool], path: str, ctx: Context
) -> Surface:
    """Return a surface with a volume inside: each shape has its own, and one that is not closed has none."""
    if is_closed():
        return replace(surface, volume=replace(volume, path=path))
    left = "it is thin-walled" if surface.interface else "it is not there"
    ctx.warn("open-interior", path, f"{surface.path} has an interior, but the mesh is not closed: {left}.")
    return replace(surface, volume=None, thin=True)


@lru_cache(maxsize=1024)
def _display_surface(appearance: Appearance) -> Surface:
    opaque = appearance.opacity == 1 and all(name != "opacity" for name, _ in appearance.inputs)
    return Surface(
        path="",
        lambert=True,
        diffuse_color=appearance.color,
        opacity=appearance.opacity,
        presence=not opaque,
        thin=not opaque,
        inputs=appearance.inputs,
    )


def undisplaced(surface: Surface, path: str, ctx: Context) -> Surface:
    """Return a surface without its displacement, for shapes that have no points to displace; this is reported."""
    if surface.displacement is None:
        return surface
    ctx.warn("displacement", path, "Only meshes can be displaced: the displacement is ignored.")
    return surface.without_displacement()


def displaces(appearance: Appearance) -> bool:
    """Return whether the appearance's material displaces its surface."""
    made = appearance.material
    return made is not None and made.surface is not None and made.surface.displacement is not None and not made.hidden


def is_cut_out(appearance: Appearance) -> bool:
    """Return whether the material's opacityThreshold cuts the whole surface out."""
    return appearance.material is not None and appearance.material.hidden


def _constant_color(prim: ResolvedPrim, ctx: Context) -> tuple[float, float, float]:
    """Return the inherited displayColor, clamped to 0 to 1, or the fallback grey."""
    if prim.inherited.color is None:
        if "primvars:displayColor" in prim.names and not _is_empty(prim, ctx):
            message = "primvars:displayColor is not a usable colour: the fallback grey is used."
            ctx.warn("invalid-primvar", prim.path, message, "primvars:displayColor")
        return FALLBACK_COLOR
    report_many_values("primvars:displayColor", element_count(prim.inherited, "primvars:displayColor"), prim.path, ctx)
    r, g, b = prim.inherited.color
    if 0.0 <= r <= 1.0 and 0.0 <= g <= 1.0 and 0.0 <= b <= 1.0:
        return prim.inherited.color
    r, g, b = (min(max(x, 0.0), 1.0) for x in prim.inherited.color)
    if (r, g, b) != tuple(prim.inherited.color):
        report_clamped_color("primvars:displayColor is", prim, ctx)
    return (r, g, b)


def _is_empty(prim: ResolvedPrim, ctx: Context) -> bool:
    """Return whether the prim's displayColor has no values."""
    raw = read(prim.prim, "primvars:displayColor", ctx.when)
    return raw is None or (hasattr(raw, "__len__") and len(raw) == 0)
