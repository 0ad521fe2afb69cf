"""Header of an image file without its pixels: size, format and metadata.

A card that shows an image is placed by the "worldtoscreen" matrix in the image's metadata.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Doubles
from .image_errors import last_error
from .image_layout import windows_of

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


# OpenImageIO before 2.2 wrote "worldtoscreen" as "worldToNDC".
_NAMES = ("worldtoscreen", "worldToNDC")


def read_matrix(path: str, read: Callable[[str], bytes]) -> Doubles | None:
    """Return the (4, 4) matrix for row vectors as written, None where the file has none; `read` as for read_header."""
    header = read_header(path, read)
    if header is None:
        return None
    for name in _NAMES:
        values = header.getattribute(name)
        if isinstance(values, tuple | list) and len(values) == 16:
            return np.array(values, np.float64).reshape(4, 4)
    return None
