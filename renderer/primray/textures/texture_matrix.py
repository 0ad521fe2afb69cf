"""The matrix that a picture's metadata says it was seen through ("worldtoscreen"): where a card made from it stands."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import PurePath

import numpy as np

from ..arrays import Doubles
from .image_error import last_error

# OpenImageIO before 2.2 wrote the first under the name of the second.
_NAMES = ("worldtoscreen", "worldToNDC")


def read_matrix(path: str, read: Callable[[str], bytes]) -> Doubles | None:
    """(4, 4), as written: for row vectors. `read` gives the bytes of a package's member ("package.usdz[member]")."""
    if not path.endswith("]"):
        return _of_file(path)
    with tempfile.NamedTemporaryFile(suffix=PurePath(path[path.rindex("[") + 1 : -1]).suffix) as unpacked:
        unpacked.write(read(path))
        unpacked.flush()
        return _of_file(unpacked.name)


def _of_file(path: str) -> Doubles | None:
    import OpenImageIO as oiio

    image = oiio.ImageInput.open(path)
    if image is None:
        last_error(oiio)
        return None
    try:
        for name in _NAMES:
            values = image.spec().getattribute(name)
            if isinstance(values, tuple | list) and len(values) == 16:
                return np.array(values, np.float64).reshape(4, 4)
        return None
    finally:
        image.close()
