"""Messages of OpenImageIO about files whose headers hold anything."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from primray.errors import SettingsError
from primray.images.image_file import read_image
from primray.textures.image_error import last_error


class Says:
    def __init__(self, message: bytes) -> None:
        self.message = message

    def geterror(self) -> Any:
        return self.message.decode()


def test_a_message_that_is_no_text_is_no_failure() -> None:
    assert last_error(Says(b" no such file\n")) == "no such file"
    assert last_error(Says(b"bad \xff")) == "its header holds bytes that are no text"


def test_an_exr_with_a_channel_list_that_is_no_text_is_a_picture_that_cannot_be_read(tmp_path: Path) -> None:
    """From the fuzz corpus (seed 11, number 131)."""
    import OpenImageIO as oiio

    path = tmp_path / "a.exr"
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    out.open(str(path), oiio.ImageSpec(4, 4, 3, "half"))
    out.write_image(np.zeros((4, 4, 3), np.float32))
    out.close()
    channel = b"R\0\x01\0\0\0\0\0"
    assert channel in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(channel, b"\x7f\xff\xff\xff\xff\xff\xff\xff"))
    with pytest.raises(SettingsError, match="no text"):
        read_image(path)


@pytest.mark.parametrize("name", [b"\xff\0", b"\x80\0"])
def test_a_channel_whose_name_is_no_text_is_refused(name: bytes, tmp_path: Path) -> None:
    import OpenImageIO as oiio

    path = tmp_path / "a.exr"
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    out.open(str(path), oiio.ImageSpec(4, 4, 3, "half"))
    out.write_image(np.zeros((4, 4, 3), np.float32))
    out.close()
    path.write_bytes(path.read_bytes().replace(b"R\0\x01\0\0\0", name + b"\x01\0\0\0"))
    with pytest.raises(SettingsError):
        read_image(path)
