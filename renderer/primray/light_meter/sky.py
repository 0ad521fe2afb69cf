"""The CIE's standard overcast sky, by which daylight factors are defined (CIE S 011, type 16; Moon and Spencer 1942)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..arrays import Floats
from ..description import Light, LightType, SceneDescription, TextureFile
from ..description.scene import without_emission
from ..textures.texture import Texture

ROWS = 1024
NAME = "primray:overcast-sky"
OUTSIDE = 7 * math.pi / 9  # illuminance of the open ground by a sky of zenith luminance 1


def overcast_sky() -> Floats:
    """Return luminances (ROWS, 2, 3) as an equirectangular image, upper row first: (1 + 2 sin of the altitude) / 3 of the
    zenith's, and nothing below the horizon."""
    altitude = math.pi * (0.5 - (np.arange(ROWS) + 0.5) / ROWS)
    luminance = np.where(altitude > 0, (1 + 2 * np.sin(altitude)) / 3, 0.0)
    return np.broadcast_to(luminance[:, None, None], (ROWS, 2, 3)).astype(np.float32)


def under_overcast_sky(description: SceneDescription) -> tuple[SceneDescription, dict[TextureFile, list[tuple[int, Texture]]]]:
    """Return the scene with no light but the overcast sky's, and the sky's image; emission of surfaces is off as well."""
    turned = np.eye(4)
    if description.up_axis == "Z":
        turned[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    file = TextureFile(NAME, "raw")
    sky = Light(NAME, LightType.DOME, turned, (1.0, 1.0, 1.0), texture=file)
    dark = replace(without_emission(description), lights=(sky,))
    return replace(dark, may_need_light=False), {file: [(0, Texture(overcast_sky()))]}
