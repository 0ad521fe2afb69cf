"""AOVs of public stages agree with each other: whatever is there has a place that projects to its pixel, a prim, a normal."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from tests.images.aovs.test_aovs import values

from primray import render
from primray.aovs import AOVS
from primray.settings import RenderSettings

ASSETS = Path(os.environ.get("PRIMRAY_ASSETS", Path(__file__).parents[4] / "shared" / "assets"))
STAGES = {
    "pixar-imaging/PointInstancer/pi_ni_pi.usda": 9,
    "pixar-imaging/PointInstancer/pi_masking.usda": None,
    "TextureCoordinateTest/TextureCoordinateTest.usda": None,
}


@pytest.mark.skipif(not ASSETS.is_dir(), reason="the shared assets are not here")
@pytest.mark.parametrize(("name", "instances"), STAGES.items())
def test_what_is_there_has_all_of_them(name: str, instances: int | None) -> None:
    size = (120, 90)
    image = render(str(ASSETS / name), RenderSettings(resolution=size, spp=2, aovs=tuple(AOVS)))
    assert image.camera is not None
    there = np.isfinite(values(image, "depth"))
    assert there.mean() > 0.02
    assert np.array_equal(there, np.isfinite(values(image, "distance")))
    assert np.array_equal(there, values(image, "prim") > 0)
    for normal in ("normal", "geometric_normal", "camera_normal"):
        np.testing.assert_allclose(np.linalg.norm(values(image, normal), axis=2), there, atol=1e-6)
    y, x = np.nonzero(there)
    centers = np.stack([x + 0.5, y + 0.5], axis=1)
    assert np.abs(image.camera.project(values(image, "position")[there], size) - centers).max() < 1e-3
    assert (values(image, "camera_normal")[there] * values(image, "camera_position")[there]).sum(axis=1).max() < 1e-3
    ids = image.aovs["instance"].ids
    if instances is not None:
        assert len(ids) == len(set(ids.values())) == instances
    for number, path in image.aovs["prim"].ids.items():
        assert path.startswith("/") or "</" in path  # what native instances share is named by the file that defines it
        assert (values(image, "prim") == number).any()
