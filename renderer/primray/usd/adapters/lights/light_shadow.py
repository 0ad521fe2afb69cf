"""UsdLux ShadowAPI: whether a light casts shadows, their colour, and up to what distance occluders count."""

from __future__ import annotations

from ....description import Shadow
from ...lights.light_color import light_color
from ...resolving.context import Context
from ...resolving.read import flag, number
from ...resolving.resolve import ResolvedPrim

_ENABLE, _COLOR = "inputs:shadow:enable", "inputs:shadow:color"
_DISTANCE, _FALLOFF, _GAMMA = "inputs:shadow:distance", "inputs:shadow:falloff", "inputs:shadow:falloffGamma"
_NAMES = frozenset({_ENABLE, _COLOR, _DISTANCE, _FALLOFF, _GAMMA})
_DEFAULT = Shadow()
# Products of larger values with radiance could overflow single precision.
_BRIGHTEST = 1e6


def shadow_of(prim: ResolvedPrim, ctx: Context) -> Shadow | None:
    """Return the shadow settings; None if they are UsdLux's defaults."""
    if _NAMES.isdisjoint(prim.names):
        return None
    distance = _number(prim, _DISTANCE, -1.0, ctx)
    falloff = _number(prim, _FALLOFF, -1.0, ctx)
    if falloff > 0 and distance < 0:
        _note(prim, _FALLOFF, "inputs:shadow:falloff has no effect without inputs:shadow:distance.", ctx)
    found = Shadow(
        flag(prim.prim, _ENABLE, ctx.when, True) if _ENABLE in prim.names else True,
        _color(prim, ctx),
        distance if distance >= 0 else -1.0,
        falloff if falloff > 0 and distance >= 0 else -1.0,
        _gamma(prim, ctx),
    )
    if not found.enabled:
        return Shadow(enabled=False)  # the other values have no effect
    return found if found.color != _DEFAULT.color or found.distance >= 0 else None


def _color(prim: ResolvedPrim, ctx: Context) -> tuple[float, float, float]:
    if _COLOR not in prim.names:
        return _DEFAULT.color
    authored = light_color(prim, _COLOR, _DEFAULT.color, ctx)
    r, g, b = (min(max(x, 0.0), _BRIGHTEST) for x in authored)
    if (r, g, b) != authored:
        _note(prim, _COLOR, f"{_COLOR} = {authored} is outside [0, {_BRIGHTEST:g}]: it is clamped.", ctx)
    return (r, g, b)


def _gamma(prim: ResolvedPrim, ctx: Context) -> float:
    gamma = _number(prim, _GAMMA, 1.0, ctx)
    if gamma < 0:
        _note(prim, _GAMMA, f"{_GAMMA} = {gamma:g} is negative: 0 is used.", ctx)
    return max(gamma, 0.0)


def _number(prim: ResolvedPrim, name: str, default: float, ctx: Context) -> float:
    return number(prim.prim, name, ctx.when, default, ctx.diagnostics) if name in prim.names else default


def _note(prim: ResolvedPrim, name: str, message: str, ctx: Context) -> None:
    ctx.warn("light-input", prim.path, message, name)
