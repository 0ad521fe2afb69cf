"""Textures come in linear Rec.709, three channels, first row at the top."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from primray import texture
from primray.description import TextureFile
from primray.errors import AssetError, LimitError
from primray.texture import load_texture


def write(path: Path, pixels: Any, kind: Any) -> str:
    pixels = np.asarray(pixels)
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), spec)
    assert out.write_image(pixels)
    out.close()
    return str(path)


def load(path: str, color_space: str = "auto") -> texture.Texture:
    return load_texture(TextureFile(path, color_space))


def test_float_files_are_raw_and_rows_start_at_the_top(tmp_path: Path) -> None:
    pixels = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    loaded = load(write(tmp_path / "a.exr", pixels, oiio.FLOAT))
    assert loaded.pixels.dtype == np.float32
    assert np.array_equal(loaded.pixels, pixels)
    assert loaded.bad_texels == 0


# sRGB code 188 is 0.50289, from IEC 61966-2-1's formula.
@pytest.mark.parametrize(
    ("channels", "color_space", "expected"),
    [(3, "auto", 0.50289), (4, "auto", 0.50289), (1, "auto", 188 / 255), (3, "raw", 188 / 255), (1, "sRGB", 0.50289)],
)
def test_eight_bits(channels: int, color_space: str, expected: float, tmp_path: Path) -> None:
    pixels = np.full((2, 2, channels), 188, np.uint8)
    loaded = load(write(tmp_path / "a.png", pixels, oiio.UINT8), color_space)
    assert loaded.pixels.shape == (2, 2, 3)
    assert np.allclose(loaded.pixels, expected, atol=1e-5)


def test_alpha_does_not_darken(tmp_path: Path) -> None:
    pixels = np.array([[[255, 0, 255, 128]]], np.uint8)
    assert np.allclose(load(write(tmp_path / "a.png", pixels, oiio.UINT8)).pixels, [1, 0, 1], atol=1e-6)


def test_sixteen_bits_are_raw_unless_said(tmp_path: Path) -> None:
    path = write(tmp_path / "a.png", np.full((1, 1, 3), 32768, np.uint16), oiio.UINT16)
    assert np.allclose(load(path).pixels, 32768 / 65535)
    assert np.allclose(load(path, "sRGB").pixels, 0.21404, atol=1e-4)


def test_named_color_spaces_go_through_ocio(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", np.ones((1, 1, 3), np.float32), oiio.FLOAT)
    assert np.allclose(load(path, "ACEScg").pixels, 1, atol=1e-3)
    with pytest.raises(AssetError, match="no colour space"):
        load(path, "nonsense")


def test_bad_texels_are_zero_and_counted(tmp_path: Path) -> None:
    pixels = np.ones((1, 4, 3), np.float32)
    pixels[0, 0, 0], pixels[0, 1, 1], pixels[0, 2, 2] = np.nan, np.inf, -1
    loaded = load(write(tmp_path / "a.exr", pixels, oiio.FLOAT))
    assert loaded.bad_texels == 3
    assert loaded.pixels[0].tolist() == [[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 1, 1]]


def test_missing_and_damaged_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="cannot be read") as caught:
        load(str(tmp_path / "no.exr"))
    assert caught.value.where == str(tmp_path / "no.exr")
    (tmp_path / "damaged.png").write_bytes(b"\x89PNG\r\n\x1a\n junk")
    with pytest.raises(AssetError, match=r"damaged\.png"):
        load(str(tmp_path / "damaged.png"))


def test_a_truncated_file_is_an_error(tmp_path: Path) -> None:
    path = Path(write(tmp_path / "a.exr", np.random.default_rng(0).random((64, 64, 3), np.float32), oiio.FLOAT))
    path.write_bytes(path.read_bytes()[:9000])
    with pytest.raises(AssetError):
        load(str(path))


def test_members_of_packages_are_read_through_the_callback(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", np.full((1, 1, 3), 2, np.float32), oiio.FLOAT)
    asked = []

    def read(path: str) -> bytes:
        asked.append(path)
        return (tmp_path / "a.exr").read_bytes()

    loaded = load_texture(TextureFile("set.usdz[sky/a.exr]", "auto"), read)
    assert asked == ["set.usdz[sky/a.exr]"]
    assert np.array_equal(loaded.pixels, np.full((1, 1, 3), 2))


def test_large_textures_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(texture, "MAX_TEXTURE_MB", 1)
    path = write(tmp_path / "a.png", np.zeros((300, 300, 3), np.uint8), oiio.UINT8)
    with pytest.raises(LimitError, match="300 x 300"):
        load(path)
