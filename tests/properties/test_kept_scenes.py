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

from .random_edits import EDITS as ANY_EDIT
from .random_edits import FRAMES, RICH, edit, enrich, stage_of

EDITS = 10  # of a stage
STAGES = 50
QUICK = 3
RICH_STAGES = 40


def settings_of(
    r: random.Random, before: RenderSettings | None, mostly: float = 0.7, dicing_rate: float = 1.0
) -> RenderSettings:
    """Mostly those of before; else another frame, camera, size or number of samples."""
    if before is not None and r.random() < mostly:
        return before
    return RenderSettings(
        resolution=(24, r.choice([12, 16])),
        spp=r.choice([2, 4, 8]),
        seed=r.choice([0, 1]),
        time_code=r.choice([None, *FRAMES]),
        camera=r.choice([None, "/eyes/cam", "/eyes/other"]),
        dicing_rate=dicing_rate,
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


def compare_all(seed: int, folder: Path, *, is_rich: bool = False) -> None:
    r = random.Random(seed)
    image = folder / "chequers.png"
    write_chequers(image)
    stage = stage_of(r, str(image) if seed % 2 else "")
    edits = ANY_EDIT
    if is_rich:
        enrich(stage, r, str(image))
        edits = (*ANY_EDIT, *RICH)
    scene = primray.Scene(stage)
    of_settings = (0.9, 0.4) if is_rich else (0.7, 1.0)
    settings = settings_of(r, None, *of_settings)
    done: list[str] = []
    for _ in range(EDITS):
        new = rendered(lambda s: primray.render(stage, s), settings)
        assert rendered(scene.render, settings) == new, done
        done.append(edit(stage, r, edits))
        settings = settings_of(r, settings, *of_settings)


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


@pytest.mark.parametrize("seed", range(QUICK))
def test_edits_of_rich_stages_leave_the_bits_of_a_new_render(seed: int, tmp_path: Path) -> None:
    """With many lights, emissive meshes, and shapes that are diced."""
    compare_all(seed, tmp_path, is_rich=True)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(QUICK, RICH_STAGES))
def test_many_edits_of_rich_stages_leave_the_bits_of_a_new_render(seed: int, tmp_path: Path) -> None:
    compare_all(seed, tmp_path, is_rich=True)
