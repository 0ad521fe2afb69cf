"""A picture that is there to be read, or why it is not."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SettingsError
from ..textures.image_error import last_error

if TYPE_CHECKING:
    import OpenImageIO as oiio


def open_picture(name: str) -> oiio.ImageInput:
    """SettingsError if there is no such file, or no picture in it."""
    import OpenImageIO as oiio

    if not Path(name).is_file():
        raise SettingsError("there is no such picture", where=name, code="image-missing")
    file = oiio.ImageInput.open(name)
    if file is None:
        raise SettingsError(f"the picture cannot be read: {last_error(oiio)}", where=name, code="image-unreadable")
    return file
