"""Texture files read with OpenImageIO as pixels in the rendering space; asset paths are resolved elsewhere (USD).

Values are as stored: alpha is straight, never colour-transformed or premultiplied; EXIF's orientation and chromaticities in a
file have no effect (UsdUVTexture's "auto" only decides whether a file is sRGB). "auto" and "sRGB" determine only the transfer
curve (UsdUVTexture): the primaries are those of USD's default space, Rec.709. An EXR's picture is its display window, whose
edges texture coordinates and directions refer to.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
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
from ..file_formats import WHAT_IT_IS, is_pointer_file, why_locked
from ..read_files import note_read
from .image_errors import fault_of_pixels, last_error
from .image_layout import Layout, Windows, choose_layer, environment_of, is_srgb, windows_of, wraps_of

MAX_TEXTURE_MB = 4096  # as floats: slightly more than 16384 x 16384 in RGB

ReadAsset = Callable[[str], bytes]


@dataclass(frozen=True, eq=False)
class Texture:
    """`pixels` (H, W, C), first row at the top, C: 1 grey; 2 grey, alpha; 3 red, green, blue; 4 with alpha (else it is 1).

    Integers are stored as in the file, a quarter or half of the size of floats, and converted on each access.
    """

    stored: npt.NDArray[Any]  # uint8, uint16, or linear float32
    srgb_channels: int = 0  # for integers: the number of channels, from the first, with sRGB's curve
    to_target: Doubles | None = None  # for integers: matrix for linear red, green and blue
    bad_texels: int = 0  # NaN or infinite texels, set to 0
    wrap_s: Wrap = Wrap.BLACK  # from the file, else the default that was passed
    wrap_t: Wrap = Wrap.BLACK
    turned: bool = False  # the file has an orientation, which texture coordinates ignore
    environment: str = ""  # environment layout in the metadata: "latlong", "cube" or ""
    content: str = ""  # key of its levels in the cache on disk (tile_cache.py), where there is one
    loader: Callable[[], Texture] | None = None  # reads the file; None: the texels are here

    @property
    def shape(self) -> tuple[int, int, int]:
        height, width, channels = self.stored.shape
        return height, width, channels

    def without_texels(self) -> Texture:
        """Return the texture's size, type and wrap modes; all of its texels are the same zero."""
        stored = np.broadcast_to(np.zeros((1, 1, 1), self.stored.dtype), self.shape)
        return replace(self, stored=stored, content="", loader=None)

    def loaded(self) -> Texture:
        """Return the texture with its texels, which are read now if they are not here."""
        return self if self.loader is None else self.loader()

    @property
    def pixels(self) -> Floats:
        return self.channels(0, self.shape[2])

    def channels(self, first: int, end: int) -> Floats:
        """Return a contiguous range of channels."""
        if self.loader is not None:
            return self.loader().channels(first, end)
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
        """Return (H, W, 3) pixels without alpha."""
        if self.shape[2] >= 3:
            return self.channels(0, 3)
        return np.repeat(self.channels(0, 1), 3, axis=2)


def load_texture(
    file: TextureFile,
    read: ReadAsset | None = None,
    *,
    path: str | None = None,
    channels: frozenset[str] = frozenset("rgba"),
    default_wrap: Wrap = Wrap.BLACK,
) -> Texture:
    """Read one image, that at `path` for a tile; only the requested `channels` need to exist.

    `read` returns the bytes of a path in a package ("package.usdz[member]"); `default_wrap` is used if the file names no wrap
    mode.
    """
    path = file.path if path is None else path
    note_read(path)
    if read is not None and path.endswith("]"):
        member = path[path.rindex("[") + 1 :].rstrip("]")
        with tempfile.NamedTemporaryFile(suffix=PurePath(member).suffix) as unpacked:
            unpacked.write(read(path))
            unpacked.flush()
            return _load_or_explain(unpacked.name, path, file, channels, default_wrap)
    return _load_or_explain(path, path, file, channels, default_wrap)


def _load_or_explain(path: str, shown: str, file: TextureFile, wanted: frozenset[str], default_wrap: Wrap) -> Texture:
    try:
        return _load(path, shown, file, wanted, default_wrap)
    except AssetError as error:
        error.message = error.message.replace(path, shown)
        fault = WHAT_IT_IS if is_pointer_file(path) else why_locked(path)
        if fault is None:
            raise
        raise AssetError(f"the texture cannot be read: {fault}", where=shown, code="texture-unreadable") from error


def _load(path: str, shown: str, file: TextureFile, wanted: frozenset[str], default_wrap: Wrap) -> Texture:
    import OpenImageIO as oiio

    oiio.attribute("limits:imagesize_MB", MAX_TEXTURE_MB)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # colours as stored, not premultiplied
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
            stored = _display_window(stored, windows, layout, wanted)
        space = _space_of(file, is_srgb(spec, path))
        turned = spec.getattribute("Orientation") not in (None, 0, 1)
        around = environment_of(spec)
        wrap_s, wrap_t = wraps_of(spec, default_wrap)
        if stored.dtype.kind == "u" and isinstance(space, ColorSpace) and (space.is_linear or _has_srgb_curve(space)):
            mixing = matrix(space, file.target) if file.is_color and layout.colors == 3 else None
            return Texture(
                stored=stored,
                srgb_channels=0 if space.is_linear else layout.colors,
                to_target=mixing,
                wrap_s=wrap_s,
                wrap_t=wrap_t,
                turned=turned,
                environment=around,
            )
        pixels = _linear(stored, layout.colors, space, file, shown)
        bad = _clear_bad(pixels) if stored.dtype.kind == "f" else 0
        return Texture(stored=pixels, bad_texels=bad, wrap_s=wrap_s, wrap_t=wrap_t, turned=turned, environment=around)
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
    """Set texels that are not finite to 0, in place; return their number."""
    with np.errstate(invalid="ignore"):  # Inf - Inf
        if np.isfinite(pixels.sum(dtype=np.float64)):  # a sum of finite floats cannot overflow in double
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
    """Return (H, W, C) texels as stored: uint8, uint16 or float32."""
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


def _display_window(stored: npt.NDArray[Any], windows: Windows, layout: Layout, wanted: frozenset[str]) -> npt.NDArray[Any]:
    """Return the display window; texels that are not stored are 0, their alpha too where the file itself has none."""
    has_alpha = len(layout.channels) > layout.colors
    if "a" in wanted and not has_alpha and not windows.covers:
        stored = np.concatenate([stored, np.ones_like(stored[:, :, :1])], axis=2)
    return windows.pictured(stored)


def _linear(stored: npt.NDArray[Any], colors: int, space: ColorSpace | str, file: TextureFile, shown: str) -> Floats:
    """Return pixels with the first `colors` channels converted from the colour space, the others as numbers."""
    if stored.dtype.kind == "u":
        pixels = _numbers(stored, _table(stored.dtype.itemsize * 8, False))
    else:
        pixels = np.asarray(stored, np.float32, order="C")  # not shared: modified in place
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
    """Convert pixels through OpenColorIO, in place; grey images keep equal channels, so only the curve affects them."""
    rgb = pixels[:, :, :3] if colors == 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
    try:
        converted = color.convert(rgb, space, target)
    except SettingsError as error:
        raise AssetError(error.message, where=shown, code="unknown-color-space") from error
    pixels[:, :, :colors] = converted[:, :, :colors]


def _numbers(codes: npt.NDArray[Any], table: Floats) -> Floats:
    """Return table[codes], some rows at a time: numpy expands each index to eight bytes first."""
    numbers = np.empty(codes.shape, np.float32)
    for row in range(0, len(codes), 64):
        numbers[row : row + 64] = table[codes[row : row + 64]]
    return numbers


@cache
def _table(bits: int, srgb: bool) -> Floats:
    """Return the value of each integer of `bits` bits."""
    values: npt.NDArray[np.float64] = np.arange(1 << bits, dtype=np.float64) / ((1 << bits) - 1)
    return (linear(values, SRGB) if srgb else values).astype(np.float32)
