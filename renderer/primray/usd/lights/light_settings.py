"""Settings of a light beside its emission: light and shadow links, shadows, group, visibility to the camera.

UsdLux has no attribute for the visibility, so attributes of other renderers are read. Lights are visible by default, as in
hdEmbree's reference implementation and in UsdLux's text ("a directly visible light"). Shadows are those of ShadowAPI.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...description import Light, Shadow
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..scene.schemas import CAMERA_VISIBILITY, LIGHT_GROUPS
from ..stage.values import flag, number, read
from .light_color import light_color
from .light_links import Links

ARNOLD, ARNOLD_DEFAULT = "primvars:arnold:aov", "default"


@dataclass(frozen=True)
class LightSettings:
    """Settings shared by all instances of one prim with LightAPI; links are collection numbers, 0 for everything."""

    shadow: Shadow | None = None
    light_link: int = 0
    shadow_link: int = 0
    group: str = ""
    visible_to_camera: bool = True

    def applied(self, light: Light) -> Light:
        """Return the light with these settings."""
        if self == _NO_SETTINGS:
            return light
        return replace(
            light,
            shadow=self.shadow,
            light_link=self.light_link,
            shadow_link=self.shadow_link,
            group=self.group,
            visible_to_camera=self.visible_to_camera,
        )


_NO_SETTINGS = LightSettings()


def read_light_settings(prim: ResolvedPrim, ctx: Context, links: Links | None) -> LightSettings:
    """Read the settings of a prim with LightAPI."""
    numbers = (0, 0) if links is None else links.of_light(prim)
    return LightSettings(read_shadow(prim, ctx), *numbers, read_group(prim, ctx), is_visible_to_camera(prim, ctx))


_ENABLE, _COLOR = "inputs:shadow:enable", "inputs:shadow:color"
_DISTANCE, _FALLOFF, _GAMMA = "inputs:shadow:distance", "inputs:shadow:falloff", "inputs:shadow:falloffGamma"
_NAMES = frozenset({_ENABLE, _COLOR, _DISTANCE, _FALLOFF, _GAMMA})
_DEFAULT_SHADOW = Shadow()
# Products of larger values with radiance could overflow single precision.
_BRIGHTEST = 1e6


def read_shadow(prim: ResolvedPrim, ctx: Context) -> Shadow | None:
    """Return the shadow settings; None if they are UsdLux's defaults."""
    if _NAMES.isdisjoint(prim.names):
        return None
    distance = _number(prim, _DISTANCE, -1.0, ctx)
    falloff = _number(prim, _FALLOFF, -1.0, ctx)
    if falloff > 0 and distance < 0:
        _warn(prim, _FALLOFF, "inputs:shadow:falloff has no effect without inputs:shadow:distance.", ctx)
    found = Shadow(
        flag(prim.prim, _ENABLE, ctx.when, True) if _ENABLE in prim.names else True,
        _color(prim, ctx),
        distance if distance >= 0 else -1.0,
        falloff if falloff > 0 and distance >= 0 else -1.0,
        _gamma(prim, ctx),
    )
    if not found.enabled:
        return Shadow(enabled=False)  # the other values have no effect
    return found if found.color != _DEFAULT_SHADOW.color or found.distance >= 0 else None


def _color(prim: ResolvedPrim, ctx: Context) -> tuple[float, float, float]:
    if _COLOR not in prim.names:
        return _DEFAULT_SHADOW.color
    authored = light_color(prim, _COLOR, _DEFAULT_SHADOW.color, ctx)
    r, g, b = (min(max(x, 0.0), _BRIGHTEST) for x in authored)
    if (r, g, b) != authored:
        _warn(prim, _COLOR, f"{_COLOR} = {authored} is outside [0, {_BRIGHTEST:g}]: it is clamped.", ctx)
    return (r, g, b)


def _gamma(prim: ResolvedPrim, ctx: Context) -> float:
    gamma = _number(prim, _GAMMA, 1.0, ctx)
    if gamma < 0:
        _warn(prim, _GAMMA, f"{_GAMMA} = {gamma:g} is negative: 0 is used.", ctx)
    return max(gamma, 0.0)


def _number(prim: ResolvedPrim, name: str, default: float, ctx: Context) -> float:
    return number(prim.prim, name, ctx.when, default, ctx.diagnostics) if name in prim.names else default


def _warn(prim: ResolvedPrim, name: str, message: str, ctx: Context) -> None:
    ctx.warn("light-input", prim.path, message, name)


_VISIBILITY_ATTRIBUTES = frozenset(CAMERA_VISIBILITY)


def is_visible_to_camera(prim: ResolvedPrim, ctx: Context) -> bool:
    """Return whether camera rays see the light; the first authored attribute of CAMERA_VISIBILITY decides."""
    if _VISIBILITY_ATTRIBUTES.isdisjoint(prim.names):
        return True
    found: list[tuple[str, bool]] = []
    for name in CAMERA_VISIBILITY:
        if name not in prim.names:
            continue
        raw = read(prim.prim, name, ctx.when)
        if not isinstance(raw, bool | int | float):
            ctx.warn("wrong-type", prim.path, f"{name} = {raw!r} is neither a bool nor a number: it is ignored.", name)
            continue
        if 0 < raw < 1:
            ctx.warn("light-input", prim.path, f"{name} = {raw:g} is a partial weight: the camera sees the whole light.", name)
        found.append((name, bool(raw > 0)))
    if not found:
        return True
    decides, seen = found[0]
    for name, other in found[1:]:
        if other != seen:
            ctx.warn("light-input", prim.path, f"{name} is ignored: {decides} has another value and comes first.", name)
    return seen


def read_group(prim: ResolvedPrim, ctx: Context) -> str:
    """Return the group's name; "" if the light is in none. Groups in render settings come before attributes of the light."""
    named = ctx.light_groups.name_of(prim.prim)
    if named:
        return named
    for name in LIGHT_GROUPS:
        if name not in prim.names:
            continue
        value = read(prim.prim, name, ctx.when)
        if isinstance(value, str) and value.strip() and not (name == ARNOLD and value == ARNOLD_DEFAULT):
            return value.strip().replace("'", "")
    return ""
