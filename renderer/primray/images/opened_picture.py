"""Opening of picture files, with an error that says why one cannot be read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SettingsError
from ..textures.image_errors import last_error

if TYPE_CHECKING:
    import OpenImageIO as oiio


def open_picture(name: str) -> oiio.ImageInput:
    """Open a picture file; SettingsError if there is no such file, or it is not a picture."""
    import OpenImageIO as oiio

    if not Path(name).is_file():
        raise SettingsError("there is no such picture", where=name, code="image-missing")
    file = oiio.ImageInput.open(name)
    if file is None:
        raise SettingsError(f"the picture cannot be read: {last_error(oiio)}", where=name, code="image-unreadable")
    return file
