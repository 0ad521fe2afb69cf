"""Renders of a scene that stays are the bits of new ones, and are told the same, whatever is edited between them."""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray import Image, RenderSettings

from .random_edits import FRAMES, edit, stage_of

EDITS = 10  # of a stage
STAGES = 50
QUICK = 3


def settings_of(r: random.Random, before: RenderSettings | None) -> RenderSettings:
    """Mostly those of before; else another frame, camera, size or number of samples."""
    if before is not None and r.random() < 0.7:
        return before
    return RenderSettings(
        resolution=(24, r.choice([12, 16])),
        spp=r.choice([2, 4, 8]),
        seed=r.choice([0, 1]),
        time_code=r.choice([None, *FRAMES]),
        camera=r.choice([None, "/eyes/cam", "/eyes/other"]),
        threads=1,
    )


def told(image: Image) -> dict[str, object]:
    report = image.report
    return {name: report[name] for name in ("pixels_sha256", "diagnostics", "scene", "features", "rays", "settings", "motion")}


def rendered(render: object, settings: RenderSettings) -> dict[str, object]:
    """Or the error that it ends with."""
    try:
        return told(render(settings))  # type: ignore[operator]
    except primray.PrimrayError as error:
        return {"error": str(error)}


def write_chequers(path: Path, bright: int = 200) -> None:
    squares = (np.indices((256, 256)).sum(axis=0) % 2 * bright).astype(np.uint8)
    spec = oiio.ImageSpec(256, 256, 3, "uint8")
    file = oiio.ImageOutput.create(str(path))
    assert file
    assert file.open(str(path), spec)
    assert file.write_image(np.ascontiguousarray(np.stack([squares] * 3, axis=2)))
    file.close()


def compare_all(seed: int, folder: Path) -> None:
    r = random.Random(seed)
    image = folder / "chequers.png"
    write_chequers(image)
    stage = stage_of(r, str(image) if seed % 2 else "")
    scene = primray.Scene(stage)
    settings = settings_of(r, None)
    done: list[str] = []
    for _ in range(EDITS):
        new = rendered(lambda s: primray.render(stage, s), settings)
        assert rendered(scene.render, settings) == new, done
        done.append(edit(stage, r))
        settings = settings_of(r, settings)


@pytest.fixture(autouse=True)
def quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", primray.RenderWarning)
        yield


@pytest.mark.parametrize("seed", range(QUICK))
def test_edits_leave_the_bits_of_a_new_render(seed: int, tmp_path: Path) -> None:
    compare_all(seed, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(QUICK, STAGES))
def test_many_edits_leave_the_bits_of_a_new_render(seed: int, tmp_path: Path) -> None:
    compare_all(seed, tmp_path)
