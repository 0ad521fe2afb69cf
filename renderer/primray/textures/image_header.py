"""Header of an image file without its pixels: size, format and metadata."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import PurePath
from typing import TYPE_CHECKING

from .image_error import last_error
from .windows import windows_of

if TYPE_CHECKING:
    import OpenImageIO as oiio


def read_header(path: str, read: Callable[[str], bytes]) -> oiio.ImageSpec | None:
    """Return an image's header with the size of its display window; None if it cannot be opened.

    `read` returns the bytes of a package's member ("package.usdz[member]").
    """
    if not path.endswith("]"):
        return _of_file(path)
    with tempfile.NamedTemporaryFile(suffix=PurePath(path[path.rindex("[") + 1 : -1]).suffix) as unpacked:
        unpacked.write(read(path))
        unpacked.flush()
        return _of_file(unpacked.name)


def _of_file(path: str) -> oiio.ImageSpec | None:
    import OpenImageIO as oiio

    image = oiio.ImageInput.open(path)
    if image is None:
        last_error(oiio)
        return None
    try:
        spec = image.spec()
        spec.width, spec.height = windows_of(spec, image.format_name()).picture
        return spec
    finally:
        image.close()
