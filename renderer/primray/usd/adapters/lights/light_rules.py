"""Settings of a light beside its emission: light and shadow links, shadows, group, visibility to the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ....description import Light, Shadow
from ...lights.light_links import Links
from ...resolving.context import Context
from ...resolving.resolve import ResolvedPrim
from .light_group import group_of
from .light_shadow import shadow_of
from .light_visibility import is_seen_by_camera


@dataclass(frozen=True)
class LightRules:
    """Settings shared by all instances of one prim with LightAPI; links are collection numbers, 0 for everything."""

    shadow: Shadow | None = None
    light_link: int = 0
    shadow_link: int = 0
    group: str = ""
    visible_to_camera: bool = True

    def applied(self, light: Light) -> Light:
        """Return the light with these settings."""
        if self == _NONE:
            return light
        return replace(
            light,
            shadow=self.shadow,
            light_link=self.light_link,
            shadow_link=self.shadow_link,
            group=self.group,
            visible_to_camera=self.visible_to_camera,
        )


_NONE = LightRules()


def rules_of(prim: ResolvedPrim, ctx: Context, links: Links | None) -> LightRules:
    """Read the settings of a prim with LightAPI."""
    numbers = (0, 0) if links is None else links.of_light(prim)
    return LightRules(shadow_of(prim, ctx), *numbers, group_of(prim, ctx), is_seen_by_camera(prim, ctx))
