"""Instanced stages look as they do with every instance a prim of its own, and big instanced stages start at once."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd
from tests.expanded import flat_stage

from primray import core, render
from primray.description import SceneDescription
from primray.report.summary import summary
from primray.settings import RenderSettings
from primray.usd import translate

ASSETS = Path(os.environ.get("PRIMRAY_ASSETS", Path(__file__).parents[3] / "shared" / "assets"))
needs_assets = pytest.mark.skipif(not ASSETS.is_dir(), reason="the shared assets are not here")
SETTINGS = RenderSettings(resolution=(96, 72), spp=16, threads=2, max_depth=3)

NAMES = (
    "PointInstancer/pi_ni_pi",
    "PointInstancer/pi_pi_varying",
    "PointInstancer/pi_masking",
    "Instancing/pi_ni_xform",
    "Instancing/sphereInstancer",
)


def picture(description: SceneDescription) -> np.ndarray:
    return core.render(core.build(description, {}, SETTINGS), SETTINGS).pixels


@needs_assets
@pytest.mark.parametrize("name", NAMES)
def test_public_stage_and_its_expansion(name: str) -> None:
    stage = Usd.Stage.Open(str(ASSETS / "pixar-imaging" / f"{name}.usda"))
    code = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    time_code = Usd.TimeCode.Default() if code is None else Usd.TimeCode(code)
    instanced, _ = translate(stage, replace(SETTINGS, time_code=code))
    flat, _ = translate(flat_stage(stage, time_code), SETTINGS)
    assert instanced.placements
    assert not flat.placements
    found, expected = picture(instanced), picture(replace(flat, camera=instanced.camera, lights=instanced.lights))
    assert expected[..., 3].mean() > 0.01
    # The same samples: rays differ by rounding, a few of them just miss.
    assert np.mean(np.abs(found - expected).max(axis=2) > 1e-4) < 0.02
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=2e-3)


@needs_assets
def test_ten_thousand_instances_start_in_seconds_and_store_one() -> None:
    path = ASSETS / "arnold-usd" / "test_0218" / "test.usda"
    start = time.perf_counter()
    image = render(str(path), RenderSettings(resolution=(32, 24), spp=1, time_code=1.0))
    assert time.perf_counter() - start < 30
    assert image.pixels[..., 3].any()
    counted = summary(translate(Usd.Stage.Open(str(path)), RenderSettings(time_code=1.0))[0])
    assert (counted.triangles_unique, counted.triangles_instanced) == (12, 120_000)
    assert counted.memory_bytes < 5e6  # 2 MB of it the film's
