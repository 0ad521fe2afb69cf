"""The "worldtoscreen" matrix in an image's metadata, by which a card that shows the image is placed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Doubles
from .image_header import read_header

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
