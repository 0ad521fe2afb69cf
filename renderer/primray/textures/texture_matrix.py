"""The matrix that a picture's metadata says it was seen through ("worldtoscreen"): where a card made from it stands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Doubles
from .image_header import read_header

# OpenImageIO before 2.2 wrote the first under the name of the second.
_NAMES = ("worldtoscreen", "worldToNDC")


def read_matrix(path: str, read: Callable[[str], bytes]) -> Doubles | None:
    """(4, 4), as written: for row vectors. `read` is as in read_header."""
    header = read_header(path, read)
    if header is None:
        return None
    for name in _NAMES:
        values = header.getattribute(name)
        if isinstance(values, tuple | list) and len(values) == 16:
            return np.array(values, np.float64).reshape(4, 4)
    return None
