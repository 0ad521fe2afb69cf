"""JPEGs with zeros where coefficients should be: damaged ones are refused, flat ones are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.description import TextureFile
from primray.errors import AssetError
from primray.textures.image_errors import zeroed_part
from primray.textures.texture import load_texture


def jpeg(folder: Path, pixels: np.ndarray, *attributes: tuple[str, object]) -> Path:
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, "uint8")
    for name, value in attributes:
        spec.attribute(name, value)
    buffer = oiio.ImageBuf(spec)
    buffer.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, channels), pixels.astype(np.float32))
    file = folder / "a.jpg"
    assert buffer.write(str(file))
    return file


def noise(channels: int) -> np.ndarray:
    return np.random.default_rng(3).random((128, 128, channels))


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(("progressive", "part"), [(0, 0.05), (0, 0.9), (1, 0.9)])  # refining scans may have zeros
def test_zeros_in_place_of_coefficients_are_damage(channels: int, progressive: int, part: float, tmp_path: Path) -> None:
    file = jpeg(tmp_path, noise(channels), ("jpeg:progressive", progressive))
    load_texture(TextureFile(str(file), "raw"))
    data = bytearray(file.read_bytes())
    scan = data.index(b"\xff\xda") + 20
    length = int((len(data) - scan) * part)
    start = scan + (0 if part > 0.5 else (len(data) - scan) // 2)
    data[start : start + length] = bytes(length)
    file.write_bytes(data)
    with pytest.raises(AssetError, match="damaged"):
        load_texture(TextureFile(str(file), "raw"))


@pytest.mark.parametrize("value", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("progressive", [0, 1])
def test_flat_pictures_and_padding_are_no_damage(value: float, channels: int, progressive: int, tmp_path: Path) -> None:
    pixels = np.full((512, 512, channels), value)
    file = jpeg(tmp_path, pixels, ("jpeg:progressive", progressive), ("Exif:ImageHistory", "x" * 10))
    file.write_bytes(file.read_bytes() + bytes(4096))
    assert zeroed_part(file.read_bytes()) is None
    assert load_texture(TextureFile(str(file), "raw")).pixels == pytest.approx(value, abs=0.01)


def test_zeros_beside_the_coefficients_are_no_damage() -> None:
    comment = b"\xff\xfe\x10\x02" + bytes(0x1000)
    tables = b"\xff\xc4\x00\x14\x10" + b"\1" + bytes(15) + b"\1"
    head = b"\xff\xd8" + comment + b"\xff\xc0\x00\x0b\x08\0\x08\0\x08\x01\x01\x11\0" + tables
    scan = b"\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00"
    assert zeroed_part(head + scan + b"\1\2\3\xff\xd9" + bytes(500)) is None
    assert zeroed_part(head + scan + bytes(63) + b"\xff\xd9") is None
    assert zeroed_part(head + scan + b"\1" + bytes(64) + b"\xff\xd9") == len(head + scan) + 1
