"""Colour of a light: colour inputs in the rendering space, and illuminants.

An illuminant is the spectrum of PhysicalLightIlluminantAPI (OpenUSD-proposals, physical-lighting) and replaces UsdLux's colour
temperature, which authored.py applies. Its colour has luminance 1, whatever a custom spectrum's scale is. Attributes are read
whether or not USD knows the schema; its fallback value, white, counts only if the schema is applied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...color.color_space import luminance_weights
from ...color.spectrum import DAYLIGHT_K, Spectrum, black_body, daylight, of_chromaticity, rgb_of
from ..scene.color_spaces import color_in_rendering_space
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..scene.schemas import ILLUMINANT as SCHEMA
from ..stage.values import array, flag, number, read, token, vector

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


ILLUMINANT, CUSTOM = "physical:illuminant", "physical:customIlluminant"
# The second is the name in NVIDIA's Omniverse, which also writes the token "illuminantD" without a space.
TEMPERATURES = ("physical:colorTemperature", "inputs:colorTemperature")
ENABLED = "inputs:enableColorTemperature"
_TOKENS = ("white", "blackbody", "illuminant D", "custom")
_BLACK_BODY_K = (500.0, 1e6)
_ATTRIBUTES = frozenset({ILLUMINANT, CUSTOM})


@dataclass(frozen=True, eq=False)
class Illuminant:
    spectrum: Spectrum
    color: Color  # in the rendering space, of luminance 1


def white(ctx: Context) -> Spectrum:
    """Return the daylight spectrum of the rendering space's white point."""
    return of_chromaticity(ctx.rendering_space.white)


def read_illuminant(prim: ResolvedPrim, ctx: Context) -> Illuminant | None:
    """Return the light's illuminant; None if neither attributes nor an applied schema give one."""
    if prim.names.isdisjoint(_ATTRIBUTES) and SCHEMA not in ctx.findings.physical_schemas.get(prim.path, ()):
        return None
    name = token(prim.prim, ILLUMINANT, ctx.when, "white")
    name = "illuminant D" if name == "illuminantD" else name
    if name not in _TOKENS:
        ctx.warn(
            "light-input", prim.path, f"{ILLUMINANT} = {name!r} is not one of {', '.join(_TOKENS)}: white is used.", ILLUMINANT
        )
        name = "white"
    if name != "custom" and CUSTOM in prim.names:
        ctx.warn("light-input", prim.path, f"{CUSTOM} is ignored: {ILLUMINANT} is {name}.", CUSTOM)
    if name in ("white", "custom") and flag(prim.prim, ENABLED, ctx.when, False):
        ctx.warn("light-input", prim.path, f"{ENABLED} is ignored: {ILLUMINANT} is {name}.", ENABLED)
    match name:
        case "blackbody":
            return _colored(prim, black_body(_kelvin(prim, _BLACK_BODY_K, ctx)), ctx)
        case "illuminant D":
            return _colored(prim, daylight(_kelvin(prim, DAYLIGHT_K, ctx)), ctx)
        case "custom":
            spectrum = _custom(prim, ctx)
            return _white_illuminant(ctx) if spectrum is None else _colored(prim, spectrum, ctx)
        case _:
            return _white_illuminant(ctx)


def _white_illuminant(ctx: Context) -> Illuminant:
    return Illuminant(white(ctx), (1.0, 1.0, 1.0))


def _kelvin(prim: ResolvedPrim, limits: tuple[float, float], ctx: Context) -> float:
    name = next((name for name in TEMPERATURES if name in prim.names), TEMPERATURES[-1])
    found = number(prim.prim, name, ctx.when, 6500.0, ctx.diagnostics)
    inside = min(max(found, limits[0]), limits[1])
    if inside != found:
        message = f"{name} = {found:g} is outside [{limits[0]:g}, {limits[1]:g}]: {inside:g} is used."
        ctx.warn("out-of-range", prim.path, message, name)
    return inside


def _custom(prim: ResolvedPrim, ctx: Context) -> Spectrum | None:
    """Return the custom spectrum; None, with a diagnostic, if it cannot be used."""
    raw = read(prim.prim, CUSTOM, ctx.when)
    pairs = None if raw is None else array(raw, 2, "f")
    wrong = _what_is_wrong(None if pairs is None else np.asarray(pairs, np.float64), is_there=raw is not None)
    if wrong or pairs is None:
        ctx.warn("light-input", prim.path, f"{CUSTOM} {wrong}: white is used.", CUSTOM)
        return None
    nm, radiance = np.asarray(pairs, np.float64).T
    if radiance.min() < 0:
        count = int((radiance < 0).sum())
        ctx.warn("out-of-range", prim.path, f"{count} radiances are negative: they are clamped to 0.", CUSTOM)
    return Spectrum(nm, np.maximum(radiance, 0.0))


def _what_is_wrong(pairs: np.ndarray | None, is_there: bool) -> str:
    if pairs is None or not np.isfinite(pairs).all():
        return "is not an array of pairs of finite numbers" if is_there else "is not authored"
    if len(pairs) < 2:
        return f"has {len(pairs)} pairs, where a spectrum has two or more"
    if not (np.diff(pairs[:, 0]) > 0).all():
        return "has wavelengths that do not ascend"
    return ""


def _colored(prim: ResolvedPrim, spectrum: Spectrum, ctx: Context) -> Illuminant:
    rgb = rgb_of(spectrum, ctx.rendering_space)
    if rgb is None or not np.isfinite(rgb).all():
        ctx.warn("light-input", prim.path, "The illuminant has no visible light: white is used.", ILLUMINANT)
        return _white_illuminant(ctx)
    if rgb.min() < 0:
        message = f"The illuminant's colour ({', '.join(f'{x:.3g}' for x in rgb)}) is outside of the rendering space's gamut: "
        ctx.warn(
            "out-of-range", prim.path, message + "negative components are clamped to 0, at the same luminance.", ILLUMINANT
        )
        rgb = np.maximum(rgb, 0.0)
        rgb = rgb / math.fsum(rgb * np.array(luminance_weights(ctx.rendering_space)))
    r, g, b = rgb.tolist()
    return Illuminant(spectrum, (r, g, b))
