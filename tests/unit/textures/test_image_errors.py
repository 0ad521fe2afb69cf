"""Messages of OpenImageIO about files whose headers hold anything."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.description.shading import TextureFile
from primray.errors import AssetError, SettingsError
from primray.images.reading import read_measured
from primray.textures.image_errors import last_error
from primray.textures.texture import load_texture


class Says:
    def __init__(self, message: bytes) -> None:
        self.message = message

    def geterror(self) -> Any:
        return self.message.decode()


def test_a_message_that_is_no_text_is_no_failure() -> None:
    assert last_error(Says(b" no such file\n")) == "no such file"
    assert last_error(Says(b"bad \xff")) == "its header contains bytes that are not text"


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
    with pytest.raises(SettingsError, match="not text"):
        read_measured(path)


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
        read_measured(path)


def jpeg(path: Path, *, progressive: bool = False) -> bytes:
    """Of 96 x 64 pixels, all alike different."""
    import OpenImageIO as oiio

    y, x = np.mgrid[0:64, 0:96]
    spec = oiio.ImageSpec(96, 64, 3, oiio.UINT8)
    spec.attribute("jpeg:progressive", int(progressive))
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    out.open(str(path), spec)
    out.write_image(np.stack([np.sin(x / 9), np.cos(y / 7), np.sin((x + y) / 20)], 2).astype(np.float32) * 0.5 + 0.5)
    out.close()
    return path.read_bytes()


def is_damaged(path: Path) -> bool:
    """As a texture and as a picture to compare, which agree."""
    found = [_is_refused(lambda: load_texture(TextureFile(str(path), "raw"))), _is_refused(lambda: read_measured(path))]
    assert found[0] == found[1]
    return found[0]


def _is_refused(read: Callable[[], object]) -> bool:
    try:
        read()
    except (AssetError, SettingsError) as damage:
        return "damaged" in damage.message
    return False


@pytest.mark.parametrize("progressive", [False, True])
def test_a_jpeg_that_was_cut_off_is_damaged(progressive: bool, tmp_path: Path) -> None:
    """libjpeg fills it with grey and warns; of a file that lacks only its end marker all pixels are there."""
    path = tmp_path / "a.jpg"
    whole = jpeg(path, progressive=progressive)
    assert not is_damaged(path)
    for cut, damaged in ((1, False), (2, False), (100, True), (len(whole) // 2, True)):
        path.write_bytes(whole[:-cut])
        assert is_damaged(path) == damaged, cut


def test_what_jpegs_say_beside_their_pixels_is_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    whole = jpeg(path)
    path.write_bytes(whole[:2] + bytes(7) + whole[2:])  # extraneous bytes before a marker
    assert not is_damaged(path)
    path.write_bytes(whole[:2] + bytes(7) + whole[2:-200])  # after which libjpeg is silent about what is missing
    assert is_damaged(path)


def test_a_jpeg_that_ends_among_its_pixels_is_damaged(tmp_path: Path) -> None:
    """Its end marker is there, so that only the decoder knows."""
    path = tmp_path / "a.jpg"
    whole = jpeg(path)
    path.write_bytes(whole[: len(whole) // 2] + whole[-2:])
    assert is_damaged(path)


@pytest.mark.parametrize("suffix", ["jpg", "png", "exr", "tif", "hdr", "bmp", "tga", "webp", "dpx", "sgi", "ppm", "pfm"])
def test_half_a_file_is_damaged_in_every_format(suffix: str, tmp_path: Path) -> None:
    import OpenImageIO as oiio

    path = tmp_path / f"a.{suffix}"
    noise = oiio.ImageBuf(oiio.ImageSpec(64, 64, 3, oiio.FLOAT))
    noise.set_pixels(oiio.ROI(0, 64, 0, 64, 0, 1, 0, 3), np.random.default_rng(0).random((64, 64, 3), np.float32))
    assert noise.write(str(path))
    load_texture(TextureFile(str(path), "raw"))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(AssetError):
        load_texture(TextureFile(str(path), "raw"))


def test_a_cut_off_picture_is_not_compared(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(jpeg(path)[:-500])
    with pytest.raises(SettingsError, match="damaged"):
        primray.compare(path, path)
