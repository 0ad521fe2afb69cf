"""Sizes of a description's textures, read from their headers alone, for `primray inspect` and its memory estimate."""

from __future__ import annotations

from collections.abc import Callable

from ..description import SceneDescription
from ..errors import AssetError
from ..textures.image_header import read_header
from .summary import ImageSize, texture_files


def texture_sizes(description: SceneDescription, read: Callable[[str], bytes]) -> dict[str, ImageSize | None]:
    """Return the image size by path; None for unreadable files. `read` is as in read_header."""
    return {path: _size(path, read) for path in texture_files(description)}


def _size(path: str, read: Callable[[str], bytes]) -> ImageSize | None:
    import OpenImageIO as oiio

    try:
        header = read_header(path, read)
    except AssetError:
        return None
    if header is None:
        return None
    kept = {oiio.UINT8: 1, oiio.UINT16: 2}.get(header.format.basetype, 4)
    return ImageSize(header.width, header.height, header.nchannels, kept)
