"""EXR holds the pixels bit for bit with the header; PNG and JPEG show them; a file is written whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.description import Projection
from primray.errors import PrimrayError, SettingsError
from primray.images import image as image_module
from primray.images.image import Image, check_output_path, encode, pixels_sha256
from primray.images.writers import exr_matrices

from ..conftest import make_camera


def read(path: Path, kind: Any = oiio.FLOAT) -> tuple[Any, Any]:
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(path), config)
    assert file is not None
    return file.read_image(0, 0, 0, file.spec().nchannels, kind), file.spec()


@pytest.fixture
def picture() -> Image:
    pixels = np.random.default_rng(1).standard_normal((5, 7, 4)).astype(np.float32)
    pixels[0, 0] = [np.inf, -0.0, 1e-42, 1e30]
    metadata: dict[str, str | int | float] = {"settings.spp": 64, "settings.seed": 2**32 - 1, "isa": "v4", "error": 0.5}
    return Image(pixels, metadata=metadata, camera=make_camera())


def test_exr_holds_the_same_bits(picture: Image, tmp_path: Path) -> None:
    pixels, spec = read(picture.save(tmp_path / "a.exr"))
    assert spec.channelnames == ("R", "G", "B", "A")
    assert spec.format == oiio.FLOAT
    assert pixels_sha256(pixels) == pixels_sha256(picture.pixels)


def test_sha_is_of_little_endian_rows_from_the_top(picture: Image) -> None:
    import hashlib
    import struct

    bits = b"".join(struct.pack("<4f", *pixel) for row in picture.pixels.tolist() for pixel in row)
    assert pixels_sha256(picture.pixels) == hashlib.sha256(bits).hexdigest()
    assert pixels_sha256(picture.pixels[::-1]) != pixels_sha256(picture.pixels)


def test_exr_header(picture: Image, tmp_path: Path) -> None:
    _, spec = read(picture.save(tmp_path / "a.exr"))
    assert spec.getattribute("compression") == "zip"
    assert spec.getattribute("PixelAspectRatio") == 1.0
    assert spec.getattribute("primray:settings.spp") == 64
    assert spec.getattribute("primray:settings.seed") == "4294967295"  # EXR's integers are signed
    assert spec.getattribute("primray:isa") == "v4"
    assert spec.getattribute("primray:error") == 0.5


@pytest.mark.parametrize("projection", list(Projection))
def test_world_to_ndc_is_where_the_camera_projects(projection: Projection, tmp_path: Path) -> None:
    angle = 0.3
    pose = np.eye(4)
    pose[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    pose[:3, 3] = [1, 2, 3]
    camera = make_camera(projection=projection, world_from_camera=pose, window=(-0.4, 0.6, -0.2, 0.3))
    points = (pose @ np.array([[0.1, 0.2, -5, 1], [-0.3, 0.1, -2, 1]]).T).T
    _, spec = read(Image(np.zeros((4, 8, 4), np.float32), camera=camera).save(tmp_path / "a.exr"))
    ndc_from_world = np.array(spec.getattribute("worldToNDC")).reshape(4, 4)  # for row vectors, as EXR has it
    ndc = points @ ndc_from_world
    expected = camera.project(points[:, :3], (1, 1))
    assert np.allclose(ndc[:, :2] / ndc[:, 3:], expected, atol=1e-5)
    in_camera = points @ np.array(spec.getattribute("worldToCamera")).reshape(4, 4)
    assert np.allclose(in_camera[:, 2], [5, 2], atol=1e-5)  # positive in front
    near_point = pose @ np.array([0, 0, -0.1, 1])
    clip = exr_matrices(camera)[1] @ near_point
    assert abs(clip[2] / clip[3]) < 1e-6


def test_png_alpha_is_straight(tmp_path: Path) -> None:
    pixels = np.zeros((1, 3, 4), np.float32)
    pixels[0, 0] = [0.25, 0.25, 0.25, 0.5]  # half covered by something of 0.5
    pixels[0, 1] = [0.5, 0.5, 0.5, 1.0]
    rgba, _ = read(Image(pixels).save(tmp_path / "a.png", view="Un-tone-mapped"), oiio.UINT8)
    assert rgba[0, :, 3].tolist() == [128, 255, 0]
    assert rgba[0, 0, :3].tolist() == rgba[0, 1, :3].tolist() == [188, 188, 188]  # the sRGB curve of 0.5
    assert rgba[0, 2, :3].tolist() == [0, 0, 0]


def test_a_shining_background_makes_the_view_opaque() -> None:
    pixels = np.full((1, 2, 4), 0.5, np.float32)
    pixels[0, 0, 3] = 0.0
    encoded = encode(pixels, view="Un-tone-mapped")
    assert encoded.tolist() == [[[188] * 3, [188] * 3]]


def test_jpeg_is_over_black(tmp_path: Path) -> None:
    pixels = np.zeros((16, 16, 4), np.float32)
    pixels[...] = [0.5, 0.5, 0.5, 1]
    rgb, spec = read(Image(pixels).save(tmp_path / "a.jpg", view="Un-tone-mapped"), oiio.UINT8)
    assert spec.nchannels == 3
    assert abs(int(rgb[8, 8, 0]) - 188) <= 1


def test_values_that_are_not_finite_are_black_in_a_view() -> None:
    pixels = np.full((1, 1, 4), np.nan, np.float32)
    pixels[..., 3] = 1
    assert encode(pixels, view="Raw").tolist() == [[[0, 0, 0]]]


def test_exposure_is_in_stops() -> None:
    pixels = np.full((1, 1, 4), 0.25, np.float32)
    pixels[..., 3] = 1
    assert encode(pixels, view="Un-tone-mapped", exposure=1.0)[0, 0, 0] == 188


def test_repr_png(picture: Image) -> None:
    assert picture._repr_png_().startswith(b"\x89PNG")


def test_pixels_are_read_only(picture: Image) -> None:
    with pytest.raises(ValueError, match="read-only"):
        picture.pixels[0, 0, 0] = 1


@pytest.mark.parametrize("name", ["a", "a.gif", "a.exr.gz"])
def test_unknown_extensions_are_refused_with_the_known_ones(name: str, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"\.exr, \.hdr, \.png") as caught:
        check_output_path(tmp_path / name)
    assert caught.value.code == "unknown-extension"


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="does not exist"):
        check_output_path(tmp_path / "no" / "a.exr")
    (tmp_path / "a.exr").mkdir()
    with pytest.raises(SettingsError, match="cannot be written"):
        check_output_path(tmp_path / "a.exr")


def test_whoever_reads_the_old_file_is_not_disturbed(picture: Image, tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"old")
    with open(tmp_path / "a.exr", "rb") as reader:
        picture.save(tmp_path / "a.exr")
        assert reader.read() == b"old"


def test_a_failed_write_leaves_the_old_file(picture: Image, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = picture.save(tmp_path / "a.exr")
    before = path.read_bytes()

    def fail(path: str, *rest: Any) -> None:
        Path(path).write_bytes(b"half")
        raise PrimrayError("disk full", code="write-failed")

    monkeypatch.setattr(image_module, "write_parts_of", fail)
    with pytest.raises(PrimrayError, match="disk full"):
        picture.save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
