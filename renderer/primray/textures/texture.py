"""Texture files as pixels of the rendering space, read with OpenImageIO. Resolving asset paths is USD's work, not done here.

Values are as stored: alpha is straight, never colour-transformed and multiplied with nothing; EXIF's orientation turns
nothing, and chromaticities in a file convert nothing (UsdUVTexture's "auto" asks a file only whether it is sRGB). "auto" and
"sRGB" speak of the curve alone (UsdUVTexture): the primaries are those of USD's default space, Rec.709's. An EXR's picture is
its display window: texture coordinates and directions go from edge to edge of that.
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

from ..arrays import Doubles, Floats
from ..color import ocio as color
from ..color.color_space import REC709, SRGB, ColorSpace, linear, matrix, transformed
from ..description import TextureFile, Wrap
from ..errors import AssetError, LimitError, SettingsError
from ..lfs_pointer import WHAT_IT_IS, is_pointer_file
from .image_error import fault_of_pixels, last_error
from .layers import choose_layer
from .texture_format import Layout, environment_of, is_srgb, wraps_of
from .windows import Windows, windows_of

MAX_TEXTURE_MB = 4096  # as float: a little more than 16384 x 16384 in RGB

ReadAsset = Callable[[str], bytes]


@dataclass(frozen=True, eq=False)
class Texture:
    """`pixels` (H, W, C), first row at the top, C: 1 grey; 2 grey, alpha; 3 red, green, blue; 4 with alpha (else it is 1).

    Integers are kept as the file has them, a quarter or half of their size as numbers, which are made at every asking.
    """

    stored: npt.NDArray[Any]  # uint8, uint16 or what they mean, as float32
    srgb_channels: int = 0  # of integers: so many of the first channels are through sRGB's curve
    to_target: Doubles | None = None  # of integers: what the linear red, green and blue are multiplied with
    bad_texels: int = 0  # NaN or infinite ones, set to 0
    wrap_s: Wrap = Wrap.BLACK  # what the file says of itself, or what is wanted where it says nothing
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
        if self.to_target is None or first >= 3:
            return self._unmixed(first, end)
        mixed = self._unmixed(0, max(end, 3))
        for row in mixed:  # in double, a row at a time: large images stay small
            row[:, :3] = transformed(row[:, :3], self.to_target)
        return np.ascontiguousarray(mixed[:, :, first:end])

    def _unmixed(self, first: int, end: int) -> Floats:
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
    file: TextureFile,
    read: ReadAsset | None = None,
    *,
    path: str | None = None,
    channels: frozenset[str] = frozenset("rgba"),
    unsaid: Wrap = Wrap.BLACK,
) -> Texture:
    """Read one image, that of `path` for a tile; of its `channels` only those that are asked for need to be there.

    `read` gives a path's bytes where it is no plain file ("package.usdz[member]"); `unsaid` is its wrap if it names none.
    """
    path = file.path if path is None else path
    if read is not None and path.endswith("]"):
        member = path[path.rindex("[") + 1 :].rstrip("]")
        with tempfile.NamedTemporaryFile(suffix=PurePath(member).suffix) as unpacked:
            unpacked.write(read(path))
            unpacked.flush()
            return _loaded(unpacked.name, path, file, channels, unsaid)
    return _loaded(path, path, file, channels, unsaid)


def _loaded(path: str, shown: str, file: TextureFile, wanted: frozenset[str], unsaid: Wrap) -> Texture:
    try:
        return _load(path, shown, file, wanted, unsaid)
    except AssetError as error:
        error.message = error.message.replace(path, shown)
        if not is_pointer_file(path):
            raise
        raise AssetError(f"the texture cannot be read: {WHAT_IT_IS}", where=shown, code="texture-unreadable") from error


def _load(path: str, shown: str, file: TextureFile, wanted: frozenset[str], unsaid: Wrap) -> Texture:
    import OpenImageIO as oiio

    oiio.attribute("limits:imagesize_MB", MAX_TEXTURE_MB)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # colours as stored, not multiplied by alpha
    image = oiio.ImageInput.open(path, config)
    if image is None:
        raise AssetError(f"the texture cannot be read: {last_error(oiio)}", where=shown, code="texture-unreadable")
    try:
        spec, layout = choose_layer(image, file.layer, shown)
        layout = layout.reduced(wanted)
        windows = windows_of(spec, image.format_name())
        for size in (windows.stored, windows.picture):
            _check_size(size, layout, shown)
        stored = _read(image, spec, layout, path, shown)
        if windows.differ:
            stored = _pictured(stored, windows, layout, wanted)
        space = _space_of(file, is_srgb(spec, path))
        turned = spec.getattribute("Orientation") not in (None, 0, 1)
        around = environment_of(spec)
        wraps = wraps_of(spec, unsaid)
        if stored.dtype.kind == "u" and isinstance(space, ColorSpace) and (space.is_linear or _has_srgb_curve(space)):
            mixing = matrix(space, file.target) if file.is_color and layout.colors == 3 else None
            return Texture(stored, 0 if space.is_linear else layout.colors, mixing, 0, *wraps, turned, around)
        pixels = _linear(stored, layout.colors, space, file, shown)
        bad = _clear_bad(pixels) if stored.dtype.kind == "f" else 0
        return Texture(pixels, 0, None, bad, *wraps, turned, around)
    finally:
        image.close()


def _space_of(file: TextureFile, looks_srgb: bool) -> ColorSpace | str:
    if not isinstance(file.color_space, str):
        return file.color_space
    chosen = {"auto": SRGB if looks_srgb else REC709, "sRGB": SRGB, "raw": file.target}
    return chosen.get(file.color_space, file.color_space)


def _has_srgb_curve(space: ColorSpace) -> bool:
    return (space.gamma, space.bias) == (SRGB.gamma, SRGB.bias)


def _clear_bad(pixels: Floats) -> int:
    """Set texels that are not finite to 0, in place; how many there were."""
    with np.errstate(invalid="ignore"):  # of Inf - Inf
        if np.isfinite(pixels.sum(dtype=np.float64)):  # adding up finite floats in double cannot overflow
            return 0
    bad = ~np.isfinite(pixels).all(axis=2)
    pixels[bad] = 0.0
    return int(np.count_nonzero(bad))


def _check_size(size: tuple[int, int], layout: Layout, shown: str) -> None:
    width, height = size
    megabytes = width * height * 4 * len(layout.channels) / 2**20
    if megabytes > MAX_TEXTURE_MB:
        raise LimitError(
            f"the texture is {width} x {height}: {megabytes:.0f} MB of float pixels, {MAX_TEXTURE_MB} allowed",
            where=shown,
            code="texture-size",
        )


def _read(image: Any, spec: Any, layout: Layout, path: str, shown: str) -> npt.NDArray[Any]:
    """(H, W, C) as stored: uint8, uint16 or float32."""
    import OpenImageIO as oiio

    kinds = {oiio.UINT8: oiio.UINT8, oiio.UINT16: oiio.UINT16}
    part = image.current_subimage()
    pixels: Any = image.read_image(part, 0, 0, max(layout.channels) + 1, kinds.get(spec.format.basetype, oiio.FLOAT))
    if pixels is None:
        raise AssetError(f"the texture is damaged: {last_error(image)}", where=shown, code="texture-unreadable")
    if fault := fault_of_pixels(image, path):
        raise AssetError(f"the texture is damaged: {fault}", where=shown, code="texture-unreadable")
    found: npt.NDArray[Any] = pixels.reshape(spec.height, spec.width, -1)
    if layout.channels == tuple(range(found.shape[2])):
        return found
    return np.ascontiguousarray(found[:, :, list(layout.channels)])


def _pictured(stored: npt.NDArray[Any], windows: Windows, layout: Layout, wanted: frozenset[str]) -> npt.NDArray[Any]:
    """The display window; what is not stored of it is 0, and its alpha too where the file itself has none."""
    has_alpha = len(layout.channels) > layout.colors
    if "a" in wanted and not has_alpha and not windows.covers:
        stored = np.concatenate([stored, np.ones_like(stored[:, :, :1])], axis=2)
    return windows.pictured(stored)


def _linear(stored: npt.NDArray[Any], colors: int, space: ColorSpace | str, file: TextureFile, shown: str) -> Floats:
    """The first `colors` channels through the colour space's curve and primaries, the others as numbers."""
    if stored.dtype.kind == "u":
        pixels = _numbers(stored, _table(stored.dtype.itemsize * 8, False))
    else:
        pixels = np.asarray(stored, np.float32, order="C")  # nobody else's: changed in place
    if isinstance(space, str):
        _convert(pixels, colors, space, file.target, shown)
        return pixels
    mixing = matrix(space, file.target) if file.is_color and colors == 3 else None
    if mixing is None and space.is_linear:
        return pixels
    for row in pixels:  # in double, a row at a time: large images stay small
        row[:, :colors] = transformed(linear(row[:, :colors], space), mixing)
    return pixels


def _convert(pixels: Floats, colors: int, space: str, target: ColorSpace, shown: str) -> None:
    """Through OpenColorIO, in place. Of a grey image only the curve is left: its channels stay equal in any of the spaces."""
    rgb = pixels[:, :, :3] if colors == 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
    try:
        converted = color.convert(rgb, space, target)
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
    return (linear(values, SRGB) if srgb else values).astype(np.float32)
