"""Textures come in linear Rec.709 with straight alpha, first row at the top: every format and layout, with exact values."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.description import TextureFile, Wrap
from primray.errors import AssetError, LimitError
from primray.textures import texture
from primray.textures.texture import load_texture


def write(path: Path, pixels: Any, kind: Any, names: str | None = None, **attributes: Any) -> str:
    """`attributes`: of the file, with "__" for ":". Without a colour space the file says nothing about it."""
    pixels = np.asarray(pixels)
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if names is not None:
        spec.channelnames = tuple(names.split(","))
        spec.alpha_channel = spec.channelnames.index("A") if "A" in spec.channelnames else -1
    for name, value in attributes.items():
        spec.attribute(name.replace("__", ":"), value)
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(pixels), out.geterror()
    out.close()
    return str(path)


def load(path: str, color_space: str = "auto", channels: str = "rgba") -> texture.Texture:
    return load_texture(TextureFile(path, color_space), channels=frozenset(channels))


def as_list(loaded: texture.Texture) -> Any:
    """All values, rounded to what a test states."""
    return np.round(loaded.pixels.astype(np.float64), 5).tolist()


@pytest.mark.parametrize("kind", [oiio.UINT8, oiio.UINT16])
def test_integers_stay_integers_until_they_are_asked_for(tmp_path: Path, kind: Any) -> None:
    """Rows more than are made at a time; every channel alone is what all of them are together."""
    path = write(tmp_path / "a.png", np.random.default_rng(1).random((150, 3, 4)).astype(np.float32), kind)
    loaded = load(path, "sRGB")
    assert loaded.stored.dtype == (np.uint8 if kind == oiio.UINT8 else np.uint16)
    stored = loaded.stored.astype(np.float64) / np.iinfo(loaded.stored.dtype).max
    expected = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    expected[..., 3] = stored[..., 3]  # alpha has no curve
    assert np.allclose(loaded.pixels, expected, atol=1e-6)
    for first, end in ((0, 1), (1, 3), (2, 4), (3, 4)):
        part = loaded.channels(first, end)
        assert part.flags.c_contiguous
        assert np.array_equal(part, loaded.pixels[:, :, first:end])


def test_float_files_are_raw_and_rows_start_at_the_top(tmp_path: Path) -> None:
    pixels = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    loaded = load(write(tmp_path / "a.exr", pixels, oiio.FLOAT))
    assert loaded.pixels.dtype == np.float32
    assert np.array_equal(loaded.pixels, pixels)
    assert loaded.bad_texels == 0


# sRGB code 188 is 0.50289, code 55 is 0.03820, from IEC 61966-2-1's formula.
RAW, LINEAR = 188 / 255, 0.50289


@pytest.mark.parametrize(
    ("channels", "color_space", "expected"),
    [
        (1, "auto", [RAW]),
        (2, "auto", [RAW, 0.2]),
        (3, "auto", [LINEAR, 0.03820, 1]),
        (4, "auto", [LINEAR, 0.03820, 1, 0.2]),
        (1, "sRGB", [LINEAR]),
        (2, "sRGB", [LINEAR, 0.2]),
        (4, "sRGB", [LINEAR, 0.03820, 1, 0.2]),
        (3, "raw", [RAW, 55 / 255, 1]),
        (4, "raw", [RAW, 55 / 255, 1, 0.2]),
    ],
)
def test_eight_bits(channels: int, color_space: str, expected: list[float], tmp_path: Path) -> None:
    """Alpha (51) is never transformed, nor are colours multiplied by it. TIFF says nothing about its colour space."""
    values = {1: [188], 2: [188, 51], 3: [188, 55, 255], 4: [188, 55, 255, 51]}[channels]
    path = write(tmp_path / "a.tif", np.full((2, 2, channels), values, np.uint8), oiio.UINT8)
    assert np.allclose(load(path, color_space).pixels, np.broadcast_to(expected, (2, 2, channels)), atol=1e-5)


def test_sixteen_bits_are_raw_unless_said(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", np.full((1, 1, 4), 32768, np.uint16), oiio.UINT16)
    assert np.array_equal(load(path).pixels, np.full((1, 1, 4), 32768 / 65535, np.float32))
    assert np.allclose(load(path, "sRGB").pixels, [0.21405, 0.21405, 0.21405, 0.50001], atol=1e-5)


def test_half_and_float_are_raw_also_negative_and_beyond_one(tmp_path: Path) -> None:
    for kind in (oiio.HALF, oiio.FLOAT):
        path = write(tmp_path / "a.exr", np.array([[[-0.5, 4.0, 0.25]]], np.float32), kind)
        assert as_list(load(path)) == [[[-0.5, 4.0, 0.25]]]
    assert np.allclose(load(path, "sRGB").pixels, [[[-0.5 / 12.92, 25.31466, 0.05088]]], atol=1e-3)


@pytest.mark.parametrize(
    ("space", "kind", "expected"), [("sRGB", oiio.UINT16, 0.50289), ("lin_rec709_scene", oiio.UINT8, 188 / 255)]
)
def test_a_png_says_itself_whether_it_is_srgb(space: str, kind: Any, expected: float, tmp_path: Path) -> None:
    """By its sRGB chunk, or a gAMA chunk of 1, against what "auto" makes of other files of its depth."""
    value = 188 * 257 if kind == oiio.UINT16 else 188
    pixels = np.full((1, 1, 3), value, np.uint16 if kind == oiio.UINT16 else np.uint8)
    assert np.allclose(load(write(tmp_path / "a.png", pixels, kind, oiio__ColorSpace=space)).pixels, expected, atol=1e-5)


def test_a_png_that_says_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    for channels, expected in ((1, RAW), (3, LINEAR)):
        write(path, np.full((1, 1, channels), 188, np.uint8), oiio.UINT8)
        path.write_bytes(without_chunks(path.read_bytes(), {b"sRGB", b"gAMA", b"cHRM"}))
        assert np.allclose(load(str(path)).pixels, expected, atol=1e-5)


def without_chunks(png: bytes, names: set[bytes]) -> bytes:
    kept, at = png[:8], 8
    while at < len(png):
        end = at + 12 + int.from_bytes(png[at : at + 4], "big")
        kept += b"" if png[at + 4 : at + 8] in names else png[at:end]
        at = end
    return kept


def test_a_palette_is_looked_up(tmp_path: Path) -> None:
    """A GIF is a palette of 8-bit colours."""
    path = write(tmp_path / "a.gif", np.array([[[255, 0, 0], [0, 255, 0]]], np.uint8), oiio.UINT8)
    assert as_list(load(path))[0][0][:3] == [1, 0, 0]
    assert as_list(load(path))[0][1][:3] == [0, 1, 0]


def test_a_palette_png(tmp_path: Path) -> None:
    """Two texels of a two-colour palette: 188 grey and (255, 0, 51)."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = zlib.compress(b"\x00\x00\x01")
    header = struct.pack(">IIBBBBB", 2, 1, 8, 3, 0, 0, 0)
    palette = bytes([188, 188, 188, 255, 0, 51])
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"PLTE", palette) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    (tmp_path / "a.png").write_bytes(png)
    assert np.allclose(load(str(tmp_path / "a.png")).pixels, [[[LINEAR] * 3, [1, 0, 0.03310]]], atol=1e-5)


def test_jpeg_grey_and_rgb(tmp_path: Path) -> None:
    grey = load(write(tmp_path / "g.jpg", np.full((8, 8, 1), 188, np.uint8), oiio.UINT8))
    assert grey.pixels.shape == (8, 8, 1)
    assert np.allclose(grey.pixels, RAW, atol=1e-5)
    assert grey.rgb().shape == (8, 8, 3)
    rgb = load(write(tmp_path / "c.jpg", np.full((8, 8, 3), 188, np.uint8), oiio.UINT8))
    assert np.allclose(rgb.pixels, LINEAR, atol=1e-5)


def test_exr_channels_go_by_name(tmp_path: Path) -> None:
    """Whatever their order in the file, which OpenEXR sorts by name; what is no colour is left out."""
    values = np.arange(5, dtype=np.float32)[None, None] / 8
    path = write(tmp_path / "a.exr", values, oiio.FLOAT, "A,Z,B,G,R")
    assert as_list(load(path)) == [[[0.5, 0.375, 0.25, 0]]]
    path = write(tmp_path / "l.exr", values, oiio.FLOAT, "N.X,N.Y,diffuse.R,diffuse.G,diffuse.B")
    assert as_list(load(path)) == [[[0.25, 0.375, 0.5]]]
    path = write(tmp_path / "y.exr", values[:, :, :2] + 0.5, oiio.FLOAT, "Y,A")
    assert as_list(load(path)) == [[[0.5, 0.625]]]


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [("r", [0.125]), ("a", [0.125, 0.5]), ("ra", [0.125, 0.5]), ("rgb", [0.125, 0.25, 0.375]), ("g", [0.125, 0.25, 0.375])],
)
def test_only_channels_that_are_read_are_kept(wanted: str, expected: list[float], tmp_path: Path) -> None:
    """As a layout of its own: 1 grey; 2 grey, alpha; 3 colour."""
    path = write(tmp_path / "a.exr", np.array([[[0.125, 0.25, 0.375, 0.5]]], np.float32), oiio.FLOAT)
    assert as_list(load(path, channels=wanted)) == [[expected]]


def test_alpha_does_not_darken(tmp_path: Path) -> None:
    """Straight as stored, also where a format's own alpha is associated (EXR)."""
    for name in ("a.png", "a.tif", "a.tga"):
        path = write(tmp_path / name, np.array([[[255, 0, 255, 128]]], np.uint8), oiio.UINT8)
        assert np.allclose(load(path).pixels, [1, 0, 1, 128 / 255], atol=1e-6)
    path = write(tmp_path / "a.exr", np.array([[[0.5, 0, 1, 0.25]]], np.float32), oiio.FLOAT)
    assert as_list(load(path)) == [[[0.5, 0, 1, 0.25]]]


def test_tiled_tx_with_its_wrap_modes(tmp_path: Path) -> None:
    pixels = np.zeros((64, 64, 3), np.float32)
    pixels[0, 0] = 1
    source = write(tmp_path / "a.exr", pixels, oiio.FLOAT)
    config = oiio.ImageSpec()
    config.attribute("wrapmodes", "periodic,clamp")
    assert oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, source, str(tmp_path / "a.tx"), config)
    loaded = load(str(tmp_path / "a.tx"))
    assert np.array_equal(loaded.pixels, pixels)
    assert (loaded.wrap_s, loaded.wrap_t) == (Wrap.REPEAT, Wrap.CLAMP)
    plain = load(source)
    assert (plain.wrap_s, plain.wrap_t) == (Wrap.BLACK, Wrap.BLACK)


def test_orientation_turns_nothing_but_is_told(tmp_path: Path) -> None:
    pixels = np.zeros((8, 16, 3), np.uint8)
    turned = load(write(tmp_path / "a.jpg", pixels, oiio.UINT8, Orientation=6))
    assert (turned.pixels.shape, turned.turned) == ((8, 16, 3), True)
    assert not load(write(tmp_path / "b.jpg", pixels, oiio.UINT8)).turned


def test_chromaticities_in_the_file_convert_nothing(tmp_path: Path) -> None:
    """UsdUVTexture's "auto" looks for sRGB only; ACEScg is to be said on the attribute."""
    ap1 = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    spec = oiio.ImageSpec(1, 1, 3, oiio.FLOAT)
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), ap1)
    out = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    assert out is not None
    assert out.open(str(tmp_path / "a.exr"), spec)
    assert out.write_image(np.array([[[0.0, 1.0, 0.0]]], np.float32))
    out.close()
    assert as_list(load(str(tmp_path / "a.exr"))) == [[[0, 1, 0]]]


def test_named_color_spaces_go_through_ocio(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", np.ones((1, 1, 3), np.float32), oiio.FLOAT)
    assert np.allclose(load(path, "ACEScg").pixels, 1, atol=1e-3)
    with pytest.raises(AssetError, match="no colour space"):
        load(path, "nonsense")


def test_primaries_are_converted_and_alpha_is_not(tmp_path: Path) -> None:
    """AP1's green in Rec.709, by the Bradford-adapted matrix (Colour & Vision: ACES to Rec.709), negative red included."""
    path = write(tmp_path / "a.exr", np.array([[[0.0, 1.0, 0.0, 0.5]]], np.float32), oiio.FLOAT)
    assert np.allclose(load(path, "lin_ap1_scene").pixels, [[[-0.62179, 1.14080, -0.12897, 0.5]]], atol=2e-4)
    grey = write(tmp_path / "g.exr", np.array([[[0.25, 0.5]]], np.float32), oiio.FLOAT, "Y,A")
    assert np.allclose(load(grey, "lin_ap1_scene").pixels, [[[0.25, 0.5]]], atol=1e-4)


def test_bad_texels_are_zero_and_counted(tmp_path: Path) -> None:
    pixels = np.ones((1, 4, 3), np.float32)
    pixels[0, 0, 0], pixels[0, 1, 1], pixels[0, 2, 2] = np.nan, np.inf, -np.inf
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
