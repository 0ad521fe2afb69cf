"""Texture files as linear Rec.709 pixels, read with OpenImageIO. Resolving asset paths is USD's work, not done here.

Values are as stored: alpha is straight, never colour-transformed and multiplied with nothing; EXIF's orientation turns
nothing, and chromaticities in a file convert nothing (UsdUVTexture's "auto" asks a file only whether it is sRGB).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import PurePath
from typing import Any

import numpy as np
import numpy.typing as npt

from . import color
from .description import Floats, TextureFile, Wrap
from .errors import AssetError, LimitError, SettingsError
from .image_error import last_error
from .texture_format import Layout, environment_of, is_srgb, layout_of, wraps_of

MAX_TEXTURE_MB = 4096  # as float: a little more than 16384 x 16384 in RGB

ReadAsset = Callable[[str], bytes]


@dataclass(frozen=True, eq=False)
class Texture:
    """`pixels` (H, W, C), first row at the top, C: 1 grey; 2 grey, alpha; 3 red, green, blue; 4 with alpha (else it is 1).

    Integers are kept as the file has them, a quarter or half of their size as numbers, which are made at every asking.
    """

    stored: npt.NDArray[Any]  # uint8, uint16 or what they mean, as float32
    srgb_channels: int = 0  # of integers: so many of the first channels are through sRGB's curve
    bad_texels: int = 0  # NaN or infinite ones, set to 0
    wrap_s: Wrap = Wrap.BLACK  # what the file says of itself
    wrap_t: Wrap = Wrap.BLACK
    turned: bool = False  # the file says it should be shown turned, which texture coordinates do not know
    environment: str = ""  # what the file says it shows of an environment: "latlong", "cube", or nothing

    @property
    def shape(self) -> tuple[int, int, int]:
        height, width, channels = self.stored.shape
        return height, width, channels

    @property
    def pixels(self) -> Floats:
        return self.channels(0, self.shape[2])

    def channels(self, first: int, end: int) -> Floats:
        """Some of the pixels' channels, contiguous."""
        part = self.stored[:, :, first:end]
        if part.dtype.kind == "f":
            return np.ascontiguousarray(part, np.float32)
        bits, curved = 8 * part.dtype.itemsize, self.srgb_channels - first
        if curved >= end - first or curved <= 0:
            return _numbers(part, _table(bits, curved > 0))
        numbers = _numbers(part, _table(bits, True))
        numbers[:, :, curved:] = _numbers(part[:, :, curved:], _table(bits, False))
        return numbers

    def rgb(self) -> Floats:
        """(H, W, 3), without alpha."""
        if self.shape[2] >= 3:
            return self.channels(0, 3)
        return np.repeat(self.channels(0, 1), 3, axis=2)


def load_texture(
    file: TextureFile, read: ReadAsset | None = None, *, path: str | None = None, channels: frozenset[str] = frozenset("rgba")
) -> Texture:
    """Read one image, that of `path` for a tile; of its `channels` only those that are asked for need to be there.

    `read` gives a path's bytes where it is no plain file ("package.usdz[member]").
    """
    path = file.path if path is None else path
    if read is not None and path.endswith("]"):
        member = path[path.rindex("[") + 1 :].rstrip("]")
        with tempfile.NamedTemporaryFile(suffix=PurePath(member).suffix) as unpacked:
            unpacked.write(read(path))
            unpacked.flush()
            return _load(unpacked.name, path, file.color_space, channels)
    return _load(path, path, file.color_space, channels)


def _load(path: str, shown: str, color_space: str, wanted: frozenset[str]) -> Texture:
    import OpenImageIO as oiio

    oiio.attribute("limits:imagesize_MB", MAX_TEXTURE_MB)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # colours as stored, not multiplied by alpha
    image = oiio.ImageInput.open(path, config)
    if image is None:
        raise AssetError(f"the texture cannot be read: {last_error(oiio)}", where=shown, code="texture-unreadable")
    try:
        spec = image.spec()
        layout = layout_of(tuple(spec.channelnames)).reduced(wanted)
        _check_size(spec, layout, shown)
        stored = _read(image, spec, layout, shown)
        space = "sRGB" if color_space == "auto" and is_srgb(spec, path) else color_space
        turned = spec.getattribute("Orientation") not in (None, 0, 1)
        if stored.dtype.kind == "u" and space in ("sRGB", "raw", "auto"):
            return Texture(stored, layout.colors if space == "sRGB" else 0, 0, *wraps_of(spec), turned, environment_of(spec))
        pixels = _linear(stored, layout.colors, space, shown)
        return Texture(
            pixels, 0, _clear_bad(pixels) if stored.dtype.kind == "f" else 0, *wraps_of(spec), turned, environment_of(spec)
        )
    finally:
        image.close()


def _clear_bad(pixels: Floats) -> int:
    """Set texels that are not finite to 0, in place; how many there were."""
    with np.errstate(invalid="ignore"):  # of Inf - Inf
        if np.isfinite(pixels.sum(dtype=np.float64)):  # adding up finite floats in double cannot overflow
            return 0
    bad = ~np.isfinite(pixels).all(axis=2)
    pixels[bad] = 0.0
    return int(np.count_nonzero(bad))


def _check_size(spec: Any, layout: Layout, shown: str) -> None:
    megabytes = spec.width * spec.height * 4 * len(layout.channels) / 2**20
    if megabytes > MAX_TEXTURE_MB:
        raise LimitError(
            f"the texture is {spec.width} x {spec.height}: {megabytes:.0f} MB of float pixels, {MAX_TEXTURE_MB} allowed",
            where=shown,
            code="texture-size",
        )


def _read(image: Any, spec: Any, layout: Layout, shown: str) -> npt.NDArray[Any]:
    """(H, W, C) as stored: uint8, uint16 or float32."""
    import OpenImageIO as oiio

    kinds = {oiio.UINT8: oiio.UINT8, oiio.UINT16: oiio.UINT16}
    pixels: Any = image.read_image(0, 0, 0, max(layout.channels) + 1, kinds.get(spec.format.basetype, oiio.FLOAT))
    if pixels is None:
        raise AssetError(f"the texture is damaged: {last_error(image)}", where=shown, code="texture-unreadable")
    found: npt.NDArray[Any] = pixels.reshape(spec.height, spec.width, -1)
    if layout.channels == tuple(range(found.shape[2])):
        return found
    return np.ascontiguousarray(found[:, :, list(layout.channels)])


def _linear(stored: npt.NDArray[Any], colors: int, space: str, shown: str) -> Floats:
    """The first `colors` channels through the colour space's curve and primaries, the others as numbers."""
    if stored.dtype.kind == "u":
        pixels = _numbers(stored, _table(stored.dtype.itemsize * 8, False))
    else:
        pixels = np.asarray(stored, np.float32, order="C")  # nobody else's: changed in place
    if space == "sRGB":
        for row in pixels:  # in double, a row at a time: large images stay small
            row[:, :colors] = _linear_from_srgb(row[:, :colors].astype(np.float64))
    elif space not in ("raw", "auto"):
        _convert(pixels, colors, space, shown)
    return pixels


def _convert(pixels: Floats, colors: int, space: str, shown: str) -> None:
    """Through OpenColorIO, in place. Of a grey image only the curve is left: its channels stay equal in any of the spaces."""
    rgb = pixels[:, :, :3] if colors == 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
    try:
        converted = color.to_rendering_space(rgb, space)
    except SettingsError as error:
        raise AssetError(error.message, where=shown, code="unknown-color-space") from error
    pixels[:, :, :colors] = converted[:, :, :colors]


def _numbers(codes: npt.NDArray[Any], table: Floats) -> Floats:
    """table[codes], some rows at a time: numpy makes eight bytes of every index first."""
    numbers = np.empty(codes.shape, np.float32)
    for row in range(0, len(codes), 64):
        numbers[row : row + 64] = table[codes[row : row + 64]]
    return numbers


@cache
def _table(bits: int, srgb: bool) -> Floats:
    """What each integer of so many bits stands for."""
    values: npt.NDArray[np.float64] = np.arange(1 << bits, dtype=np.float64) / ((1 << bits) - 1)
    return (_linear_from_srgb(values) if srgb else values).astype(np.float32)


def _linear_from_srgb(v: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """IEC 61966-2-1, also beyond 1; negative values stay on the curve's linear part."""
    return np.where(v <= 0.04045, v / 12.92, np.power((np.maximum(v, 0.04045) + 0.055) / 1.055, 2.4))
