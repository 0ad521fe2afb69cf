"""Textures arrive in the rendering space: curve, then primaries, against double precision; integers wait as stored."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from tests.colorimetry import AP1, P3_D65, between, from_srgb
from tests.colorimetry import REC709 as PUBLISHED
from tests.described import describe

from primray.checkpoints.fingerprint import fingerprint
from primray.color.color_space import ACESCG, REC709, SRGB, ColorSpace, matrix, named
from primray.description import Light, LightType, SceneDescription, TextureFile
from primray.diagnostics import Diagnostics
from primray.textures.texture import Texture, load_texture

from .loading import load_texture_set

TO_AP1 = between(PUBLISHED, AP1)
CODES = np.random.default_rng(3).integers(0, 256, (7, 5, 4), np.uint8)
P3 = named("lin_p3d65_scene")


@pytest.fixture
def coded(tmp_path: Path) -> str:
    return write(tmp_path / "codes.png", CODES, "uint8")


def write(path: Path, pixels: npt.NDArray[np.generic], kind: str) -> str:
    """Straight alpha, and no word about colours."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), spec)
    assert out.write_image(pixels)
    out.close()
    return str(path)


def loaded(path: str, space: str | ColorSpace, target: ColorSpace = ACESCG, *, is_color: bool = True) -> Texture:
    return load_texture(TextureFile(path, space, (), target, is_color))


@pytest.mark.conforms("UsdUVTexture.inputs:sourceColorSpace")
@pytest.mark.parametrize("space", ["auto", "sRGB", SRGB])
def test_8_bit_srgb_is_the_curve_and_then_the_matrix(space: str | ColorSpace, coded: str) -> None:
    made = loaded(coded, space)
    assert made.stored.dtype == np.uint8  # a quarter of floats, until the core asks
    expected = from_srgb(CODES[..., :3] / 255) @ TO_AP1.T
    assert np.allclose(made.pixels[..., :3], expected, rtol=0, atol=3e-6)
    assert np.array_equal(made.pixels[..., 3], (CODES[..., 3] / 255).astype(np.float32))
    for first, end in ((0, 1), (1, 3), (2, 4), (3, 4), (0, 3)):
        assert np.array_equal(made.channels(first, end), made.pixels[:, :, first:end])


def test_rounding_is_that_of_a_float(coded: str) -> None:
    """Against the same matrix in double: curve and product add less than one unit in the last place each."""
    by = matrix(REC709, ACESCG)
    assert by is not None
    exact = from_srgb(CODES[..., :3] / 255) @ by.T
    assert np.abs(loaded(coded, "sRGB").pixels[..., :3] / exact - 1).max() < 2.0**-22


@pytest.mark.conforms("UsdUVTexture.inputs:sourceColorSpace")
def test_raw_and_numbers_are_not_mixed(coded: str) -> None:
    plain = (CODES / 255).astype(np.float32)
    assert np.array_equal(loaded(coded, "raw").pixels, plain)
    assert np.allclose(loaded(coded, "sRGB", is_color=False).pixels[..., :3], from_srgb(CODES[..., :3] / 255), atol=1e-7)
    assert np.array_equal(loaded(coded, ACESCG).pixels, plain)


def test_rec709_scenes_keep_their_integers_and_take_no_matrix(coded: str) -> None:
    made = loaded(coded, "auto", REC709)
    assert made.to_target is None
    assert made.stored.dtype == np.uint8


def test_other_curves(coded: str) -> None:
    gamma, p3 = named("g22_rec709_scene"), named("srgb_p3d65_scene")
    assert gamma is not None
    assert p3 is not None
    assert np.allclose(loaded(coded, gamma).pixels[..., :3], (CODES[..., :3] / 255) ** 2.2 @ TO_AP1.T, atol=3e-6)
    to_ap1 = between(P3_D65, AP1)
    assert np.allclose(loaded(coded, p3).pixels[..., :3], from_srgb(CODES[..., :3] / 255) @ to_ap1.T, atol=3e-6)
    assert loaded(coded, p3).stored.dtype == np.uint8


@pytest.mark.parametrize("kind", ["float", "half", "uint16"])
def test_linear_files_without_a_word_are_rec709(kind: str, tmp_path: Path) -> None:
    """Not "as it was read" alone: what is in no space by USD's rules is in linear Rec.709 (ColorSpaceAPI)."""
    pixels = np.random.default_rng(4).random((3, 4, 3), np.float32)
    path = write(tmp_path / ("a.tif" if kind == "uint16" else "a.exr"), pixels, kind)
    stored = np.asarray(oiio.ImageBuf(path).get_pixels(oiio.FLOAT))
    assert np.allclose(loaded(path, "auto").pixels, stored @ TO_AP1.T, atol=3e-6)
    assert np.allclose(loaded(path, "auto", REC709).pixels, stored, rtol=1e-7)
    assert np.allclose(loaded(path, "raw").pixels, stored, rtol=1e-7)


def test_grey_files_stay_grey(tmp_path: Path) -> None:
    path = write(tmp_path / "g.png", CODES[..., :1].copy(), "uint8")
    assert np.allclose(loaded(path, "sRGB").pixels[..., 0], from_srgb(CODES[..., 0] / 255), atol=1e-7)


def test_chromaticities_in_a_file_say_nothing(tmp_path: Path) -> None:
    """UsdUVTexture's "auto" asks a file only whether it is sRGB."""
    path = str(tmp_path / "a.exr")
    spec = oiio.ImageSpec(1, 1, 3, "float")
    numbers = tuple(x for corner in AP1 for x in corner)
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), numbers)
    out = oiio.ImageOutput.create(path)
    assert out is not None
    assert out.open(path, spec)
    assert out.write_image(np.array([[[0.0, 1.0, 0.0]]], np.float32))
    out.close()
    assert np.allclose(loaded(path, "auto").pixels[0, 0], TO_AP1[:, 1], atol=3e-6)


def dome(file: TextureFile) -> Light:
    return Light(f"/{file.color_space}", LightType.DOME, np.eye(4), (1.0, 1.0, 1.0), texture=file)


def test_lights_that_differ_in_the_space_alone_have_images_of_their_own(coded: str) -> None:
    files = [TextureFile(coded, space) for space in ("auto", "raw", ACESCG)]
    description = with_lights(*map(dome, files))
    found = load_texture_set(description, Diagnostics(), None)
    images = [found[file][0][1].rgb() for file in files]
    assert np.allclose(images[0], from_srgb(CODES[..., :3] / 255), atol=1e-7)
    assert np.allclose(images[1], CODES[..., :3] / 255, atol=1e-7)
    assert not np.allclose(images[2], images[1], atol=1e-2)
    digests = {fingerprint(with_lights(dome(file)), {file: found[file]})["lights"] for file in files}
    assert len(digests) == 3


def with_lights(*lights: Light) -> SceneDescription:
    return replace(describe().description, lights=lights)


def test_light_outside_the_rendering_space_keeps_its_other_channels(tmp_path: Path) -> None:
    """The green of P3 has less than no red in Rec.709: light of it is not black."""
    green = np.zeros((1, 1, 3), np.uint8)
    green[..., 1] = 255
    path = write(tmp_path / "green.png", green, "uint8")
    p3 = named("srgb_p3d65_scene")
    assert p3 is not None
    file = TextureFile(path, p3)
    notes = Diagnostics()
    found = load_texture_set(with_lights(dome(file)), notes, None)
    assert np.allclose(found[file][0][1].rgb()[0, 0], np.maximum(between(P3_D65, PUBLISHED)[:, 1], 0), atol=2e-6)
    assert [d.code for d in notes] == ["texture-bad-texels"]
