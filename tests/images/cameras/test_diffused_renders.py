"""Diffusion of a render: its record keeps its bits, its file gets a part, what views show changes; off is as if it were not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray.images.image import pixels_sha256

SCENE = Path(__file__).resolve().parents[3] / "scenes/features/light-sphere/scene.usda"
SMALL: dict[str, Any] = {"resolution": (48, 32), "spp": 8, "max_depth": 3}


def names_of(path: Path) -> dict[str, tuple[str, ...]]:
    file = oiio.ImageInput.open(str(path))
    assert file is not None
    found: dict[str, tuple[str, ...]] = {}
    while file.seek_subimage(len(found), 0):
        found[file.spec().get_string_attribute("name", "only")] = tuple(file.spec().channelnames)
    return found


def test_the_record_keeps_its_bits(tmp_path: Path) -> None:
    plain, image = primray.render(SCENE, **SMALL), primray.render(SCENE, diffusion=0.3, **SMALL)
    assert pixels_sha256(image.pixels) == pixels_sha256(plain.pixels)
    assert image.errors is not None
    assert plain.errors is not None
    assert (image.errors == plain.errors).all()
    assert image.diffused is not None
    assert image.diffused.errors is not None
    assert image.report["diffusion"]["strength"] == 0.3
    assert image.report["stages_s"]["diffusion"] > 0
    assert (image.to_uint8() == image.diffused.to_uint8()).all()
    assert (image.to_uint8() != plain.to_uint8()).any()
    image.save(tmp_path / "a.exr")
    again = primray.read_image(tmp_path / "a.exr")
    assert (again.pixels == plain.pixels).all()
    assert again.diffused is not None
    assert again.diffused.errors is not None
    assert (again.diffused.pixels == image.diffused.pixels).all()
    assert (again.diffused.errors == image.diffused.errors).all()
    assert not again.aovs


@pytest.mark.parametrize("aovs", [[], ["depth"]])
def test_its_part_has_channels_of_its_name(tmp_path: Path, aovs: list[str]) -> None:
    primray.render(SCENE, diffusion=0.3, aovs=aovs, **SMALL).save(tmp_path / "a.exr")
    parts = names_of(tmp_path / "a.exr")
    assert list(parts) == ["rgba", *aovs, "diffused"]
    colors = [f"diffused.{c}" for c in "RGBA"]
    assert parts["diffused"] == (*colors, *(f"diffused.stderr.{c}" for c in "RGB"))


def test_off_it_leaves_no_trace(tmp_path: Path) -> None:
    """Nor does a flag that says it is off, but for what the header says was asked."""
    variants: list[dict[str, Any]] = [{}, {"diffusion": 0.0}]
    images = [primray.render(SCENE, **SMALL, **more) for more in variants]
    for image, name in zip(images, ("a", "b"), strict=True):
        assert image.diffused is None
        assert "diffusion" not in image.report
        assert "diffusion" not in image.report["stages_s"]
        image.save(tmp_path / f"{name}.exr")
        assert names_of(tmp_path / f"{name}.exr") == {"only": ("R", "G", "B", "A", "stderr.R", "stderr.G", "stderr.B")}
    assert (images[0].pixels == images[1].pixels).all()
    said = (tmp_path / "a.exr").read_bytes()
    assert b"diffus" not in said
    assert b"settings.eye" not in said


def tiles(values: Any) -> Any:
    """Sums over 8 x 8 pixels, of each channel."""
    return values.reshape(4, 8, 6, 8, 3).sum(axis=(1, 3))


@pytest.mark.long
def test_its_errors_are_those_of_many_renders() -> None:
    """Variances over seeds against the mean of the squared errors that each render tells."""
    scene, pixels, told = SCENE.parents[1] / "camera-lens/scene.usda", [], []
    for seed in range(100):
        found = primray.render(scene, seed=seed, diffusion=0.5, diffusion_bloom_width=0.05, **SMALL).diffused
        assert found is not None
        assert found.errors is not None
        pixels.append(found.pixels[..., :3].astype(np.float64))
        told.append(np.square(found.errors, dtype=np.float64))
    seen, said = tiles(np.var(pixels, axis=0, ddof=1)), tiles(np.mean(told, axis=0))
    np.testing.assert_allclose(seen / said, 1.0, atol=0.2)
    assert seen.sum() / said.sum() == pytest.approx(1.0, abs=0.04)
