"""What belongs to a light beside its emission: whom it reaches, who casts its shadows and how, whether the camera sees it."""

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
    """Of all instances of one prim with LightAPI."""

    shadow: Shadow | None = None
    light_link: int = 0
    shadow_link: int = 0
    group: str = ""
    visible_to_camera: bool = True

    def applied(self, light: Light) -> Light:
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
    numbers = (0, 0) if links is None else links.of_light(prim)
    return LightRules(shadow_of(prim, ctx), *numbers, group_of(prim, ctx), is_seen_by_camera(prim, ctx))
