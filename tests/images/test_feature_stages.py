"""Stages of scenes/features as pictures: all show something, what moves is blurred where it should be, a fisheye is a disc."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

import primray
from primray.images.image import Image

FOLDER = Path(__file__).parents[2] / "scenes" / "features"
STAGES = sorted(path.parent.name for path in FOLDER.glob("*/scene.usda"))
MOVING = [name for name in STAGES if name.startswith(("motion-", "rolling-"))]


def shown(name: str, width: int = 96, spp: int = 8, **more: object) -> Image:
    stage = Usd.Stage.Open(str(FOLDER / name / "scene.usda"))
    frame = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    return primray.render(stage, resolution=(width, 0), spp=spp, time_code=frame, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", STAGES)
def test_all_show_something(name: str) -> None:
    pixels = shown(name, 48, 4).pixels
    assert np.isfinite(pixels).all()
    assert pixels[..., :3].std() > 0.01


@pytest.mark.parametrize("name", MOVING)
def test_what_moves_is_told_and_seen(name: str) -> None:
    blurred, still = shown(name), shown(name, motion_blur=False)
    assert blurred.report["motion"]["moving"]
    assert not still.report["motion"]
    assert np.abs(blurred.pixels - still.pixels)[..., :3].max() > 0.1


def test_blur_lies_where_the_shutter_and_its_scale_put_it() -> None:
    """From 0.1 before the frame to 0.4 after it, at 2.2 units a time code; twice that, and not at all."""
    blurred, still = shown("motion-shutter", 240, 64), shown("motion-shutter", 240, 64, motion_blur=False)
    differs = np.abs(blurred.pixels - still.pixels)[..., :3].max(axis=-1) > 0.1
    camera = still.camera
    assert camera is not None
    for height, scale in ((2.35, 0.0), (1.45, 1.0), (0.55, 2.0)):
        reach = [scale * -0.22 - 0.35, scale * 0.88 + 0.35]
        (left, row), (right, _) = camera.project([(x, height, 0.0) for x in reach], still.resolution)
        columns = np.flatnonzero(differs[round(row) - 2 : round(row) + 2].any(axis=0))
        if scale == 0:
            assert len(columns) == 0
        else:
            assert left - 1 < columns[0] < left + 9 * scale
            assert right - 12 * scale < columns[-1] < right + 1


def test_a_fisheye_of_180_degrees_is_a_disc() -> None:
    """1000 / pi pixels a radian, of a sensor 1024 high."""
    seen = shown("lens-fisheye", 192).pixels[..., 3]
    y, x = np.mgrid[: seen.shape[0], : seen.shape[1]] + 0.5
    radius = np.hypot(x - seen.shape[1] / 2, y - seen.shape[0] / 2) / seen.shape[0] * 1024
    edge = 1024 / seen.shape[0]
    assert (seen[radius > 500 + edge] == 0).all()
    ground = (radius < 500 - edge) & (y > seen.shape[0] * 0.72)
    assert ground.sum() > 1000
    assert (seen[ground] == 1).all()
