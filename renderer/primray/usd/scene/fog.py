"""Fog that fills the scene, by the attributes `primray:fog:...` of PrimrayFogAPI: of the camera, or else of the stage's default
prim.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from pxr import Usd

from ...description import Fog, Light, LightType
from ..stage.metadata import default_prim, meters_per_unit, up_axis
from ..stage.reads import property_names
from ..stage.values import number, report_without_value, vector
from .color_spaces import color_in_rendering_space, scope_of
from .context import Context
from .droplets import diameter

PREFIX = "primray:fog:"
DENSITY, COLOR, ANISOTROPY = f"{PREFIX}density", f"{PREFIX}color", f"{PREFIX}anisotropy"
DROPLETS = f"{PREFIX}dropletDiameter"
EMISSION, TOP, FALLOFF = f"{PREFIX}emission", f"{PREFIX}top", f"{PREFIX}falloff"
NAMES = frozenset({DENSITY, COLOR, ANISOTROPY, DROPLETS, EMISSION, TOP, FALLOFF})
MOST_ANISOTROPY = float(np.float32(0.98))
MOST_ENDLESS = 0.99  # albedo of fog without a top: light that is never absorbed would be scattered without an end
Color = tuple[float, float, float]


def fog_of(camera: Usd.Prim | None, lights: Iterable[Light], ctx: Context) -> Fog | None:
    """Return the fog that the camera's prim asks for, or else the stage's default prim; None where neither does."""
    path = default_prim(ctx.stage)
    for prim in (camera, None if path is None else ctx.stage.GetPrimAtPath(path)):
        if prim and any(name.startswith(PREFIX) for name in property_names(prim)):
            return _read(prim, lights, ctx)
    return None


def _read(prim: Usd.Prim, lights: Iterable[Light], ctx: Context) -> Fog | None:
    path = ctx.shown(str(prim.GetPath()))
    for name in sorted(property_names(prim)):
        if name.startswith(PREFIX) and name not in NAMES:
            ctx.warn("unknown-input", path, f"{name} is ignored: PrimrayFogAPI has no such attribute.", name)
    report_without_value(prim, NAMES, ctx.when, ctx.diagnostics)
    metres = meters_per_unit(ctx.stage)
    density = _at_least_zero(prim, DENSITY, path, ctx) * metres
    emission = _color(prim, EMISSION, (0.0, 0.0, 0.0), path, ctx)
    emission = (emission[0] * metres, emission[1] * metres, emission[2] * metres)
    if density == 0 and not any(emission):
        return None
    r, g, b = _color(prim, COLOR, (1.0, 1.0, 1.0), path, ctx)
    if max(r, g, b) > 1:
        ctx.warn("out-of-range", path, f"{COLOR} is above 1, and is clamped: fog scatters no more light than there is.", COLOR)
    anisotropy = number(prim, ANISOTROPY, ctx.when, 0.0, ctx.diagnostics)
    if abs(anisotropy) > MOST_ANISOTROPY:
        most = f"{MOST_ANISOTROPY:g}"
        message = f"{ANISOTROPY} = {anisotropy:g} is outside [-{most}, {most}] and is clamped."
        ctx.warn("out-of-range", path, message, ANISOTROPY)
    droplets = diameter(prim, DROPLETS, ctx)
    if droplets > 0 and prim.GetAttribute(ANISOTROPY).HasAuthoredValue():
        ctx.warn("material-input", path, f"{ANISOTROPY} has no effect: {DROPLETS} gives the phase function.", ANISOTROPY)
    made = Fog(
        path=str(prim.GetPath()),
        density=density,
        albedo=(min(r, 1.0), min(g, 1.0), min(b, 1.0)),
        emission=emission,
        anisotropy=min(max(anisotropy, -MOST_ANISOTROPY), MOST_ANISOTROPY),
        droplets=droplets,
        top=_top(prim, ctx),
        up=(0.0, 0.0, 1.0) if up_axis(ctx.stage) == "Z" else (0.0, 1.0, 0.0),
        falloff=_at_least_zero(prim, FALLOFF, path, ctx),
    )
    if made.top is not None:
        return made
    _report_endless(made, path, lights, ctx)
    r, g, b = made.albedo
    if max(r, g, b) > MOST_ENDLESS and prim.GetAttribute(COLOR).HasAuthoredValue():
        message = (
            f"{COLOR} is above {MOST_ENDLESS:g} in fog without a top, and is clamped: light would be scattered without an end."
        )
        ctx.warn("out-of-range", path, message, COLOR)
    return replace(made, albedo=(min(r, MOST_ENDLESS), min(g, MOST_ENDLESS), min(b, MOST_ENDLESS)))


def _top(prim: Usd.Prim, ctx: Context) -> float | None:
    """Return the height of the fog's top; None without a top."""
    attribute = prim.GetAttribute(TOP)
    if not attribute or not attribute.HasAuthoredValue():
        return None
    top = number(prim, TOP, ctx.when, math.nan, ctx.diagnostics, "the fog has no top")
    return None if math.isnan(top) else top


def _report_endless(fog: Fog, path: str, lights: Iterable[Light], ctx: Context) -> None:
    """Report fog without a top where it hides lights at infinity."""
    far = [light.path for light in lights if light.type in (LightType.DOME, LightType.DISTANT)]
    if far and fog.density > 0:
        message = f"The fog has no top: it hides all light from infinity ({', '.join(far[:3])}). Author {TOP} to let it in."
        ctx.warn("endless-fog", path, message, TOP)


def _at_least_zero(prim: Usd.Prim, name: str, path: str, ctx: Context) -> float:
    found = number(prim, name, ctx.when, 0.0, ctx.diagnostics)
    if found < 0:
        ctx.warn("out-of-range", path, f"{name} = {found:g} is below 0: 0 is used.", name)
    return max(found, 0.0)


def _color(prim: Usd.Prim, name: str, default: Color, path: str, ctx: Context) -> Color:
    r, g, b = vector(prim, name, ctx.when, default, ctx.diagnostics)
    attribute = prim.GetAttribute(name)
    if attribute and attribute.HasAuthoredValue():
        r, g, b = color_in_rendering_space((r, g, b), attribute, scope_of(attribute, ctx), ctx)
    if min(r, g, b) < 0:
        ctx.warn("out-of-range", path, f"{name} is below 0: 0 is used.", name)
    return max(r, 0.0), max(g, 0.0), max(b, 0.0)
