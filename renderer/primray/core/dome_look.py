"""What the image and distributions of a dome in the core depend on, so that a scene can take them from an earlier one."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..description import Light, TextureFile
from ..textures.texture import Texture


@dataclass(frozen=True, eq=False)
class DomeLook:
    """What the tables of a dome depend on, for a scene that takes them from an earlier one."""

    image: weakref.ref[object] | None  # the Texture or array; None: constant
    rest: tuple[object, ...] | None  # None: its tables are of no use to another scene

    def is_like(self, other: DomeLook) -> bool:
        if self.rest is None or self.rest != other.rest:
            return False
        if self.image is None or other.image is None:
            return self.image is other.image
        return self.image() is not None and self.image() is other.image()


def dome_look(light: Light, textures: Mapping[TextureFile, Sequence[tuple[int, Texture]]]) -> DomeLook:
    """Return the look of a dome; portals are weighed in its tables, and are not kept."""
    tiles = [] if light.texture is None else textures.get(light.texture, [])
    image: object = light.image if light.image is not None else tiles[0][1] if tiles else None
    rules = light.light_link, light.shadow_link, light.shadow, light.diffuse != 0 or light.specular != 0
    rest = None if light.portals else (light.texture_format, tuple(map(float, light.emission)), *rules)
    return DomeLook(None if image is None else weakref.ref(image), rest)
