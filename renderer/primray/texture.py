"""Texture files as linear Rec.709 pixels, read with OpenImageIO. Resolving asset paths is USD's work, not done here."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np

from . import color
from .description import Floats, TextureFile, Wrap
from .errors import AssetError, LimitError, SettingsError

MAX_TEXTURE_MB = 4096  # as float RGB: a little more than a 16384 x 16384 image


@dataclass(frozen=True, eq=False)
class Texture:
    pixels: Floats  # (H, W, C), C from 1 to 4, linear Rec.709, first row at the top
    bad_texels: int = 0  # NaN, infinite or negative ones, set to 0
    wrap_s: Wrap = Wrap.BLACK  # what the file's metadata say
    wrap_t: Wrap = Wrap.BLACK


def load_texture(file: TextureFile, read: Callable[[str], bytes] | None = None) -> Texture:
    """Read one image; `read` gives a path's bytes where it is no plain file ("package.usdz[member]")."""
    if read is not None and file.path.endswith("]"):
        member = file.path[file.path.rindex("[") + 1 : -1]
        with tempfile.NamedTemporaryFile(suffix=PurePath(member).suffix) as unpacked:
            unpacked.write(read(file.path))
            unpacked.flush()
            pixels, is_srgb = _read_pixels(unpacked.name, file)
    else:
        pixels, is_srgb = _read_pixels(file.path, file)
    pixels = _linear(pixels, file, is_srgb)
    bad = ~np.isfinite(pixels) | (pixels < 0)
    bad_texels = int(np.count_nonzero(bad.any(axis=2)))
    if bad_texels:
        pixels[bad.any(axis=2)] = 0.0
    return Texture(pixels, bad_texels)


def _read_pixels(path: str, file: TextureFile) -> tuple[Floats, bool]:
    """(H, W, 3) as stored, and whether "auto" means sRGB: 8 bits with 3 or 4 channels (UsdUVTexture's sourceColorSpace)."""
    import OpenImageIO as oiio

    oiio.attribute("limits:imagesize_MB", MAX_TEXTURE_MB)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # colours as stored, not multiplied by alpha
    image = oiio.ImageInput.open(path, config)
    if image is None:
        raise AssetError(f"the texture cannot be read: {oiio.geterror().strip()}", where=file.path, code="texture-unreadable")
    try:
        spec = image.spec()
        megabytes = spec.width * spec.height * 12 / 2**20
        if megabytes > MAX_TEXTURE_MB:
            raise LimitError(
                f"the texture is {spec.width} x {spec.height}: {megabytes:.0f} MB of float pixels, {MAX_TEXTURE_MB} allowed",
                where=file.path,
                code="texture-size",
            )
        channels = 3 if spec.nchannels >= 3 else 1
        pixels: Any = image.read_image(0, 0, 0, channels, oiio.FLOAT)
        if pixels is None:
            raise AssetError(f"the texture is damaged: {image.geterror().strip()}", where=file.path, code="texture-unreadable")
        rgb = np.broadcast_to(pixels.reshape(spec.height, spec.width, channels), (spec.height, spec.width, 3))
        return np.array(rgb, np.float32, order="C"), spec.format.basetype == oiio.UINT8 and spec.nchannels >= 3
    finally:
        image.close()


def _linear(pixels: Floats, file: TextureFile, is_srgb: bool) -> Floats:
    space = file.color_space
    if space == "raw" or (space == "auto" and not is_srgb):
        return pixels
    if space in ("auto", "sRGB"):
        for row in pixels:  # in double, a row at a time: large images stay small
            row[:] = _linear_from_srgb(row.astype(np.float64))
        return pixels
    try:
        return color.to_rendering_space(pixels, space)
    except SettingsError as error:
        raise AssetError(error.message, where=file.path, code="unknown-color-space") from error


def _linear_from_srgb(v: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """IEC 61966-2-1, also beyond 1; negative values stay on the curve's linear part."""
    return np.where(v <= 0.04045, v / 12.92, np.power((np.maximum(v, 0.04045) + 0.055) / 1.055, 2.4))
