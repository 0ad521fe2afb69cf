"""Lights for the core's builder, with the images and photometric profiles that several may share. Part of scene_upload."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..arrays import Doubles, Floats
from ..description import Light, LightType, Shaping, TextureFile
from .surface_upload import Textures

# Order of LightType in light/light.hpp.
LIGHT_NUMBERS = {
    LightType.POINT: 0,
    LightType.SPHERE: 1,
    LightType.DISK: 2,
    LightType.RECT: 3,
    LightType.CYLINDER: 4,
    LightType.DISTANT: 5,
    LightType.DOME: 6,
    LightType.LINE: 8,
}
# Order of DomeFormat in light/dome_format.hpp; one that nothing has settled is read as lat-long.
DOME_FORMATS = {"automatic": 0, "latlong": 0, "mirroredBall": 1, "angular": 2, "cubeMapVerticalCross": 3}
NO_TEXTURE = np.zeros((0, 0, 3), np.float32)


class LightUpload:
    def __init__(self, builder: Any) -> None:
        self._builder = builder
        self._profiles: dict[int, int] = {}  # the core's numbers by identity, since lights share them
        self._images: dict[TextureFile, int] = {}

    def add(self, lights: Iterable[Light], textures: Textures) -> None:
        """Those that stand by themselves."""
        for light in lights:
            pixels, image = NO_TEXTURE, -1
            if light.type is LightType.RECT:
                image = self._image(light.texture, textures)
            elif light.type is LightType.DOME:
                pixels = light_pixels(light.texture, textures)
            portals = np.array([[*p.world_from_portal[:3].ravel(), p.width, p.height] for p in light.portals], np.float64)
            self._builder.add_light(
                LIGHT_NUMBERS[light.type],
                np.ascontiguousarray(light.world_from_light, np.float64),
                light,
                pixels,
                DOME_FORMATS[light.texture_format],
                portals.reshape(-1, 14),
                image,
                self._profile(light.shaping),
            )

    def add_worn(self, light: Light, group_from_object: Doubles) -> int:
        """One that shapes are, which stand so; its number."""
        number: int = self._builder.add_geometry_light(group_from_object, light, self._profile(light.shaping))
        return number

    def _image(self, file: TextureFile | None, textures: Textures) -> int:
        if file is None or file not in textures:
            return -1
        if file not in self._images:
            self._images[file] = self._builder.add_light_image(light_pixels(file, textures))
        return self._images[file]

    def _profile(self, shaping: Shaping | None) -> int:
        """-1 without one."""
        if shaping is None or shaping.ies is None:
            return -1
        profile = shaping.ies
        if id(profile) not in self._profiles:
            horizontal, candela = profile.horizontal_deg, profile.candela
            if len(horizontal) == 1:
                horizontal, candela = np.array([0.0, 360.0], np.float32), np.concatenate([candela, candela])
            self._profiles[id(profile)] = self._builder.add_ies_profile(
                profile.vertical_deg, horizontal, candela, profile.horizontal_pole
            )
        return self._profiles[id(profile)]


def light_pixels(file: TextureFile | None, textures: Textures) -> Floats:
    """(H, W, 3), or no pixels: a light without a texture is constant."""
    tiles = [] if file is None else textures.get(file, [])
    if not tiles:
        return NO_TEXTURE
    return tiles[0][1].rgb()
