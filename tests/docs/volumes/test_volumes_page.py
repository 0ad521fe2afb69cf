"""docs/volumes.md: its stages are rendered as they are shown, and its pictures are theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import primray

from . import pictures

EXPECTED = {"camera-chosen", "volume-convention", "translated", "denoised-worse"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("page")
    pictures.write_stages(made)
    return made


def pixels_of(path: Path) -> pictures.Floats:
    found = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)
    assert found is not None
    return np.asarray(found[..., :3], np.float64)


def test_all_stages_have_pictures() -> None:
    assert tuple(pictures.stages()) == pictures.NAMES
    assert {path.stem for path in pictures.FOLDER.glob("*.jpg")} == set(pictures.NAMES)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", pictures.NAMES)
def test_stages_are_those_of_the_pictures(name: str, folder: Path) -> None:
    """The picture, seen from afar, is that of a render with few samples."""
    image = primray.render(folder / f"{name}.usda", resolution=(24, 24), spp=256, denoise=True)
    assert {d["code"] for d in image.report["diagnostics"]} <= EXPECTED
    shown, kept = pixels_of(image.save(folder / f"{name}.png")), pixels_of(pictures.FOLDER / f"{name}.jpg")
    assert kept.shape == (*pictures.SIZE[::-1], 3)
    side = pictures.SIZE[0] // 24
    afar = kept.reshape(24, side, 24, side, 3).mean(axis=(1, 3))
    assert np.abs(afar - shown).mean() < 0.04
