"""Colour space of a value in USD, and its conversion to the rendering space.

The space is an attribute's own colorSpace metadata, else the nearest ColorSpaceAPI's colorSpace:name at its prim or above,
else linear Rec.709 (ColorSpaceAPI). Custom spaces (ColorSpaceDefinitionAPI) are known where they are defined and below, the
nearest one of a name first; they win over names that USD knows. Ancestors of an instance count as ancestors of everything in
its prototype. UsdColorSpaceAPI's own functions stop at prototypes; a test checks that they agree elsewhere.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Usd

from ...color import ocio as color
from ...color.color_space import REC709, ColorSpace, is_gamut
from ...errors import SettingsError
from ..stage.reads import color_space_name, has_color_space
from ..stage.values import value
from .context import NO_COLOR_SCOPE, ColorScope, Context
from .schemas import applied_schemas

_DEFINITION = "ColorSpaceDefinitionAPI:"
# ColorSpaceDefinitionAPI's fallbacks: RGB equals XYZ.
_DEFAULTS = {"redChroma": (1.0, 0.0), "greenChroma": (0.0, 1.0), "blueChroma": (0.0, 0.0), "whitePoint": (1 / 3, 1 / 3)}


def scope_below(above: ColorScope, prim: Usd.Prim, schemas: list[str], ctx: Context) -> ColorScope:
    """Return a prim's scope, given its parent's; `schemas` are those applied to the prim."""
    if not any(schema.startswith("ColorSpace") for schema in schemas):
        return above
    own = [made for schema in schemas if schema.startswith(_DEFINITION) and (made := _definition(prim, schema, ctx))]
    name = _token(prim, "colorSpace:name", ctx) if "ColorSpaceAPI" in schemas else ""
    return ColorScope(name or above.name, (*own, *(d for d in above.definitions if d.name not in {o.name for o in own})))


def scope_of(attribute: Usd.Attribute, ctx: Context) -> ColorScope:
    """Return the scope at an attribute's prim."""
    found = ctx.caches.color_scopes.get((attribute.GetPrimPath(), ctx.outer_colors))
    return scope_at(attribute.GetPrim(), ctx) if found is None else found


def scope_at(prim: Usd.Prim, ctx: Context) -> ColorScope:
    """Return the scope at a prim; a prototype's root inherits from its instance, whose scope `ctx.outer_colors` has."""
    if not prim:
        return NO_COLOR_SCOPE
    key, known = (prim.GetPath(), ctx.outer_colors), ctx.caches.color_scopes
    found = known.get(key)
    if found is None:
        found = known[key] = _scope_at(prim, ctx)
    return found


def _scope_at(prim: Usd.Prim, ctx: Context) -> ColorScope:
    path = prim.GetPath()
    if path.IsAbsoluteRootPath():
        return NO_COLOR_SCOPE
    if path.IsRootPrimPath() and prim.IsPrototype():
        return outer_scope(str(path), ctx.outer_colors)
    schemas = applied_schemas(prim)
    return scope_below(scope_at(prim.GetParent(), ctx), prim, schemas, ctx)


def outer_scope(path: str, outer: tuple[tuple[str, ColorScope], ...]) -> ColorScope:
    """Return the scope that instances pass on to the prototype with `path`."""
    root = path[: path.find("/", 1)] if "/" in path[1:] else path
    return next((scope for prototype, scope in outer if prototype == root), NO_COLOR_SCOPE)


def authored_space(attribute: Usd.Attribute, scope: ColorScope, ctx: Context, own: str | None = None) -> color.Source | None:
    """Return the authored space of an attribute; None where nothing is authored, or the name is unknown, which is reported.

    `own`: the name in the attribute's own metadata, where that has been read.
    """
    name = (color_space_name(attribute) if own is None else own) or scope.name
    if not name:
        return None
    found = space_named(name, scope, ctx)
    if found is None:
        path = ctx.shown(str(attribute.GetPrim().GetPath()))
        message = f"Unknown colour space {name!r}: the values are treated as linear Rec.709."
        ctx.warn("color-space", path, message, str(attribute.GetName()))
    return found


def space_named(name: str, scope: ColorScope, ctx: Context) -> color.Source | None:
    """Return a custom space in scope, else one of USD or of the OCIO configuration; None if unknown."""
    for definition in scope.definitions:
        if definition.name == name:
            return definition
    known = ctx.caches.color_spaces
    if name not in known:
        try:
            known[name] = color.space_named(name)
        except SettingsError:  # the configuration is unreadable, which is reported when an image is displayed
            known[name] = None
    return known[name]


def rendering_space(settings_path: str, wanted: str | None, ctx: Context) -> ColorSpace:
    """Return the user's rendering space, else RenderSettings', else linear Rec.709; SettingsError if the user's is invalid."""
    asked = ctx.settings.rendering_color_space
    if asked is None and not wanted:
        return REC709
    scope = scope_at(ctx.stage.GetPrimAtPath(settings_path), ctx) if settings_path else NO_COLOR_SCOPE
    name = asked or wanted or ""
    defined = next((space for space in scope.definitions if space.name == name), None)
    if defined is not None and color.is_rendering_space(defined):
        return defined
    try:
        return color.rendering_space(name)
    except SettingsError as error:
        if asked is not None:
            raise
        ctx.warn("color-space", settings_path, f"{error.message}: linear Rec.709 is used.", "renderingColorSpace")
        return REC709


def in_rendering_space(
    values: npt.NDArray[np.floating],
    attribute: Usd.Attribute,
    scope: ColorScope,
    ctx: Context,
    *,
    assumed: bool = True,
    own: str | None = None,
) -> npt.NDArray[np.floating]:
    """Return (..., 3) colours converted to the rendering space.

    Without an authored space, colours are linear Rec.709 if `assumed`, else unconverted. `own`: as for `authored_space`.
    """
    if _is_plain(attribute, scope, ctx, assumed, own):
        return values
    source = authored_space(attribute, scope, ctx, own)
    if source is None:
        source = REC709 if assumed else ctx.rendering_space
    if isinstance(source, ColorSpace) and (source.is_data or _same(source, ctx.rendering_space)):
        return values
    try:
        return color.convert(np.asarray(values), source, ctx.rendering_space)
    except SettingsError as error:
        path = ctx.shown(str(attribute.GetPrim().GetPath()))
        ctx.warn("color-space", path, f"{error.message}: the values are not converted.", str(attribute.GetName()))
        return values


def color_in_rendering_space(
    rgb: tuple[float, float, float],
    attribute: Usd.Attribute,
    scope: ColorScope,
    ctx: Context,
    *,
    assumed: bool = True,
    own: str | None = None,
) -> tuple[float, float, float]:
    """Return one colour converted to the rendering space, as `in_rendering_space` does."""
    if _is_plain(attribute, scope, ctx, assumed, own):
        return rgb
    given = np.array(rgb, np.float64)
    found = in_rendering_space(given, attribute, scope, ctx, assumed=assumed, own=own)
    return rgb if found is given else (float(found[0]), float(found[1]), float(found[2]))


def _is_plain(attribute: Usd.Attribute, scope: ColorScope, ctx: Context, assumed: bool, own: str | None) -> bool:
    """Return whether nothing needs conversion: a fast check, since most stages author no colour spaces."""
    if scope is not NO_COLOR_SCOPE or (assumed and ctx.rendering_space is not REC709):
        return False
    return not (has_color_space(attribute) if own is None else own)


def _same(source: ColorSpace, target: ColorSpace) -> bool:
    return source.is_linear and source.gamut == target.gamut


def _definition(prim: Usd.Prim, schema: str, ctx: Context) -> ColorSpace | None:
    """Return the space of a ColorSpaceDefinitionAPI instance; None, reported, where its numbers are invalid."""
    prefix = f"colorSpaceDefinition:{schema.removeprefix(_DEFINITION)}:"
    name = _token(prim, prefix + "name", ctx) or "custom"
    chroma = [_numbers(prim, prefix + key, default, ctx) for key, default in _DEFAULTS.items()]
    gamma, bias = (_numbers(prim, prefix + key, (default,), ctx) for key, default in (("gamma", 1.0), ("linearBias", 0.0)))
    if None not in chroma and gamma is not None and bias is not None:
        red, green, blue, white = ((c[0], c[1]) for c in chroma if c is not None)
        made = ColorSpace(name=name, red=red, green=green, blue=blue, white=white, gamma=gamma[0], bias=bias[0])
        if is_gamut(made) and made.gamma > 0 and made.bias >= 0 and (made.gamma > 1 or made.bias == 0):
            return made
    ctx.warn(
        "color-space", ctx.shown(str(prim.GetPath())), f"{prefix[:-1]} does not define a valid colour space and is ignored."
    )
    return None


def _token(prim: Usd.Prim, name: str, ctx: Context) -> str:
    attribute = prim.GetAttribute(name)
    found = value(attribute, ctx.when) if attribute else None
    return str(found) if isinstance(found, str) else ""


def _numbers(prim: Usd.Prim, name: str, default: tuple[float, ...], ctx: Context) -> tuple[float, ...] | None:
    attribute = prim.GetAttribute(name)
    raw: Any = value(attribute, ctx.when) if attribute and attribute.HasAuthoredValue() else None
    if raw is None:
        return default
    try:  # single precision has seven digits: 0.63999998 means 0.64
        numbers = tuple(round(float(x), 7) for x in ((raw,) if isinstance(raw, int | float) else raw))
    except (TypeError, ValueError):
        return None
    return numbers if len(numbers) == len(default) and all(map(math.isfinite, numbers)) else None
