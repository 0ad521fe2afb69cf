"""What becomes of lights once their textures are read: which are left out, and how a dome's image is laid out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from ..description.lighting import Light, LightType
from ..diagnostics import Diagnostics
from ..photometry.scaled import BRIGHTEST, DARK, TOO_BRIGHT, scaled, within
from .texture import Texture
from .texture_set import TextureSet

FORMAT = "inputs:texture:format"


def with_read_textures(lights: Iterable[Light], textures: TextureSet, diagnostics: Diagnostics) -> tuple[Light, ...]:
    """Rectangles shine without a texture that could not be read; a sky whose image is missing is no plain colour: left out."""
    kept = []
    for light in lights:
        if light.texture is None:
            kept.append(light)
        elif light.texture not in textures:
            if light.type is LightType.RECT:
                kept.append(_measured(replace(light, texture=None), None, diagnostics))
        else:
            image = textures[light.texture][0][1]
            if light.type is LightType.DOME:
                light = _settled(light, image, diagnostics)
            kept.append(_measured(light, image, diagnostics))
    return tuple(kept)


def _measured(light: Light, image: Texture | None, diagnostics: Diagnostics) -> Light:
    """As bright as it is to be, through its image."""
    if light.photometric is None:
        return light
    found = scaled(light, light.photometric, None if image is None else image.rgb())
    if found is None:
        diagnostics.add("light-dark", light.path, DARK)
        return replace(light, emission=(0.0, 0.0, 0.0), photometric=None)
    if max(found.emission) > BRIGHTEST:
        diagnostics.add("out-of-range", light.path, TOO_BRIGHT)
    return within(found)


def _settled(dome: Light, image: Texture, diagnostics: Diagnostics) -> Light:
    """With the format that "automatic" turns out to be, by what the file says of itself or, if it says nothing, its shape."""
    height, width, _ = image.shape
    asked = dome.texture_format
    if asked != "automatic":
        _note_shape(dome, width, height, diagnostics)
        return dome
    if image.environment == "cube":
        message = "The file says that it is OpenEXR's cube map, which is not read: it is taken as lat-long."
        diagnostics.add("light-input", dome.path, message, FORMAT)
    elif not image.environment:
        if 4 * width == 3 * height:
            return replace(dome, texture_format="cubeMapVerticalCross")
        if width == height > 1:
            message = "The image is square and does not say what it shows: it is read as lat-long, not mirroredBall or angular."
            diagnostics.add("light-input", dome.path, message, FORMAT)
    return replace(dome, texture_format="latlong")


def _note_shape(dome: Light, width: int, height: int, diagnostics: Diagnostics) -> None:
    shapes = {"mirroredBall": (1, 1), "angular": (1, 1), "cubeMapVerticalCross": (3, 4)}
    across, down = shapes.get(dome.texture_format, (width, height))
    if width * down != height * across:
        message = (
            f"The image is {width} x {height}, where {dome.texture_format} is {across} to {down}: it is stretched to that."
        )
        diagnostics.add("light-input", dome.path, message, FORMAT)
