"""Bits and halves: what is written is read back to within a step of what was asked for, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.color.color_space import REC709, matrix, named
from primray.diagnostic_messages import RenderWarning
from primray.errors import SettingsError
from primray.images.aov import Aov
from primray.images.image import Image
from primray.images.reading import read_image


def _image(**changes: Any) -> Any:
    random = np.random.default_rng(3)
    pixels = random.uniform(0.01, 1, (5, 7, 4)).astype(np.float32)
    pixels[..., :3] *= pixels[..., 3:]
    aovs = {
        "depth": Aov(np.full((5, 7, 1), 1 / 3, np.float32), ("Z",), "depth", "how far"),
        "prim": Aov(np.full((5, 7, 1), 70_001, np.uint32), ("prim",), "prim", "which", "uint", {70_001: "/a"}),
    }
    errors = np.full((5, 7, 3), 1 / 7, np.float32)
    return replace(Image(pixels, errors=errors, aovs=aovs), **changes)


def _read(path: Path) -> tuple[Any, Any]:
    straight: Any = oiio.ImageSpec()
    straight.attribute("oiio:UnassociatedAlpha", 1)
    view = path.suffix == ".png" or "view" in path.name
    file: Any = oiio.ImageInput.open(str(path), straight) if view else oiio.ImageInput.open(str(path))
    spec = file.spec()
    return spec, file.read_image(0, 0, 0, spec.nchannels, spec.format)


@pytest.mark.parametrize(("name", "bits"), [("a.png", 8), ("a.png", 16), ("view.tif", 8), ("view.tiff", 16)])
def test_views_have_the_bits_that_are_asked_for(tmp_path: Path, name: str, bits: Any) -> None:
    image = _image()
    spec, values = _read(image.save(tmp_path / name, bit_depth=bits))
    assert str(spec.format) == f"uint{bits}"
    straight = image.to_uint8() / 255
    step = 0.51 / 255 if bits == 16 else 0.0
    np.testing.assert_allclose(values / (2**bits - 1), straight, rtol=0, atol=step)


def test_16_bits_tell_apart_what_8_do_not(tmp_path: Path) -> None:
    ramp = np.ones((1, 256, 4), np.float32)
    ramp[..., :3] = np.linspace(0.2, 0.21, 256, dtype=np.float32)[:, None]
    wide = [len(np.unique(_read(Image(ramp).save(tmp_path / "a.png", bit_depth=bits))[1][..., 0])) for bits in (8, 16)]
    assert wide[0] < 5
    assert wide[1] > 150


def test_a_tiff_of_32_bits_is_the_picture_itself(tmp_path: Path) -> None:
    image = _image()
    spec, values = _read(image.save(tmp_path / "a.tif", bit_depth=32))
    assert str(spec.format) == "float"
    np.testing.assert_array_equal(values, image.pixels)


def test_files_that_cannot_say_their_space_are_rec709(tmp_path: Path) -> None:
    space = named("lin_ap1_scene")
    assert space is not None
    image = _image(color_space=space)
    by = matrix(space, REC709)
    assert by is not None
    _, values = _read(image.save(tmp_path / "a.tif", bit_depth=32))
    np.testing.assert_allclose(values[..., :3], image.pixels[..., :3].astype(np.float64) @ by.T, rtol=1e-5, atol=1e-6)


def test_radiance_files_hold_light_over_black(tmp_path: Path) -> None:
    pixels = _image().pixels.copy()
    pixels[0, 0], pixels[1, 1, 0], pixels[2, 2, 1] = (1e6, 2e6, 3e6, 1), -1, np.inf
    _, values = _read(Image(pixels).save(tmp_path / "a.hdr"))
    assert values.shape == (5, 7, 3)
    shown = np.where(np.isfinite(pixels), np.maximum(pixels, 0), 0)[..., :3]
    assert (np.abs(values - shown) <= shown.max(axis=2, keepdims=True) / 128).all()


@pytest.mark.parametrize("name", ["all", "rgba", "R"])
def test_channels_are_halves_where_asked_for(tmp_path: Path, name: str) -> None:
    image = _image()
    path = image.save(tmp_path / "a.exr", half=[name])
    again = read_image(path)
    halves = image.pixels.astype(np.float16).astype(np.float32)
    np.testing.assert_array_equal(again.pixels[..., 0], halves[..., 0])
    np.testing.assert_array_equal(again.pixels[..., 1], (image.pixels if name == "R" else halves)[..., 1])
    assert again.errors is not None
    assert image.errors is not None
    told = image.errors.astype(np.float16) if name == "all" else image.errors
    np.testing.assert_array_equal(again.errors, told)
    assert again.aovs["depth"].stored == ("half" if name == "all" else "float")
    assert again.aovs["prim"].values[0, 0, 0] == 70_001  # never a half


def test_layers_and_parts_are_named_by_themselves(tmp_path: Path) -> None:
    image = _image()
    again = read_image(image.save(tmp_path / "a.exr", half=["stderr", "depth"]))
    np.testing.assert_array_equal(again.pixels, image.pixels)
    assert again.aovs["depth"].values[0, 0, 0] == np.float16(1 / 3)
    assert again.errors is not None
    assert again.errors[0, 0, 0] == np.float16(1 / 7)


def test_what_halves_cannot_hold_is_told(tmp_path: Path) -> None:
    pixels = _image().pixels.copy()
    pixels[0, :2, 1] = 70_000
    with pytest.warns(RenderWarning, match="G: 2 values exceed 65504"):
        Image(pixels).save(tmp_path / "a.exr", half=["G"])
    with pytest.warns(RenderWarning, match="no channel, layer or part is named depth"):
        Image(pixels).save(tmp_path / "a.exr", half=["depth"])


@pytest.mark.parametrize(("name", "bits"), [("a.png", 32), ("a.png", 12), ("a.tif", 64)])
def test_bits_that_a_format_does_not_have(tmp_path: Path, name: str, bits: Any) -> None:
    with pytest.raises(SettingsError, match="bits a channel"):
        _image().save(tmp_path / name, bit_depth=bits)
    assert not (tmp_path / name).exists()
