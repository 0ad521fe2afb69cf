"""Lights after their textures are read: which are left out, their brightness, and the layout of dome images."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import replace

from ..arrays import Doubles
from ..description.lighting import Light, LightType, Photometric
from ..diagnostics import Diagnostics
from ..photometry.light_shape import shape_key
from ..photometry.scaled import BRIGHTEST_EMISSION, DARK_TEXT, TOO_BRIGHT_TEXT, amount_of_unit_emission, clamped, scaled_to
from .texture import Texture
from .texture_set import TextureSet

FORMAT = "inputs:texture:format"


def with_read_textures(lights: Iterable[Light], textures: TextureSet, diagnostics: Diagnostics) -> tuple[Light, ...]:
    """Return the lights with textures that could be read.

    Rectangles shine without a texture that could not be read; domes are left out, since a sky is not a plain colour.
    """
    kept = []
    measure = _Measure(textures, diagnostics)
    for light in lights:
        if light.texture is None:
            kept.append(light)
        elif light.texture not in textures:
            if light.type is LightType.RECT:
                kept.append(measure.measured(replace(light, texture=None)))
        elif light.type is LightType.DOME:
            kept.append(measure.measured(_settled(light, textures[light.texture][0][1], diagnostics)))
        else:
            kept.append(measure.measured(light))
    return tuple(kept)


class _Measure:
    """Scaling of lights to their photometric values through their images, cached for lights that differ only in placement."""

    def __init__(self, textures: TextureSet, diagnostics: Diagnostics) -> None:
        self._textures = textures
        self._diagnostics = diagnostics
        self._known: dict[Hashable, Doubles] = {}

    def measured(self, light: Light) -> Light:
        if light.photometric is None:
            return light
        found = scaled_to(light, light.photometric, self._of_one(light, light.photometric))
        if found is None:
            self._diagnostics.add("light-dark", light.path, DARK_TEXT)
            return replace(light, emission=(0.0, 0.0, 0.0), photometric=None)
        if max(found.emission) > BRIGHTEST_EMISSION:
            self._diagnostics.add("out-of-range", light.path, TOO_BRIGHT_TEXT)
        return clamped(found)

    def _of_one(self, light: Light, wanted: Photometric) -> Doubles:
        stands = light.world_from_light[:3, :3].tobytes() if light.type is LightType.DOME else shape_key(light)
        key = (light.texture, light.texture_format, light.type, light.shaping, wanted.distance, wanted.up, stands)
        if key not in self._known:
            image = None if light.texture is None else self._textures[light.texture][0][1].rgb()
            self._known[key] = amount_of_unit_emission(light, wanted, image)
        return self._known[key]


def _settled(dome: Light, image: Texture, diagnostics: Diagnostics) -> Light:
    """Return the dome with the format that "automatic" stands for: what the file's metadata say, else by its aspect ratio."""
    height, width, _ = image.shape
    asked = dome.texture_format
    if asked != "automatic":
        _note_shape(dome, width, height, diagnostics)
        return dome
    if image.environment == "cube":
        message = "The file is an OpenEXR cube map, which is not supported: it is read as lat-long."
        diagnostics.add("light-input", dome.path, message, FORMAT)
    elif not image.environment:
        if 4 * width == 3 * height:
            return replace(dome, texture_format="cubeMapVerticalCross")
        if width == height > 1:
            message = (
                "The image is square and its metadata have no layout: it is read as lat-long, not mirroredBall or angular."
            )
            diagnostics.add("light-input", dome.path, message, FORMAT)
    return replace(dome, texture_format="latlong")


def _note_shape(dome: Light, width: int, height: int, diagnostics: Diagnostics) -> None:
    shapes = {"mirroredBall": (1, 1), "angular": (1, 1), "cubeMapVerticalCross": (3, 4)}
    across, down = shapes.get(dome.texture_format, (width, height))
    if width * down != height * across:
        message = f"The image is {width} x {height}, but {dome.texture_format} is {across} to {down}: it is stretched to that."
        diagnostics.add("light-input", dome.path, message, FORMAT)
