"""Pictures with volumes, taken apart: light path expressions, alpha, the log of a pixel, clamped light, ranges of samples."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.checkpoints.resuming import scene, settings
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

import primray
from primray import Image, core

pytestmark = pytest.mark.filterwarnings("ignore")
EVENTS = ("CO", "CL", "C<RD>[LO]", "C<RD>.+[LO]", "C<R[GS]>.*[LO]", "C<T.>.*[LO]", "CV[LO]", "CV.+[LO]")
SIZE, SPP = (24, 16), 16
LIGHTS = """
def SphereLight "Lamp" {
    float inputs:intensity = 60
    float inputs:radius = 0.5
    double3 xformOp:translate = (8, 9, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DistantLight "Sun" {
    float inputs:intensity = 2
    float inputs:angle = 0
    double3 xformOp:rotateXYZ = (-60, 20, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""
CAMERA = """
def Camera "Cam" {
    float horizontalAperture = 24
    float verticalAperture = 16
    float focalLength = 40
    float2 clippingRange = (0.1, 1000)
    double3 xformOp:translate = (3.5, 4.5, 32)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
FLOOR = """
def Mesh "Floor" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-20, -2, 20), (20, -2, 20), (20, -2, -20), (-20, -2, -20)]
    color3f[] primvars:displayColor = [(0.6, 0.5, 0.4)]
}
"""
LOOK = """
def Material "Look" {
    token outputs:arnold:volume.connect = </Look/Shader.outputs:out>
    def Shader "Shader" {
        uniform token info:id = "arnold:standard_volume"
        float inputs:density = 0.4
        color3f inputs:scatter_color = (0.9, 0.8, 0.6)
        float inputs:scatter_anisotropy = 0.4
        token outputs:out
    }
}
"""


def cloud() -> np.ndarray:
    return np.random.default_rng(5).random(512)


def stage(folder: Path, text: str, name: str = "stage.usda") -> str:
    path = folder / name
    path.write_text(f'#usda 1.0\n(\n    upAxis = "Y"\n    metersPerUnit = 1\n)\n{CAMERA}{text}')
    return str(path)


def smoke(folder: Path) -> str:
    """Smoke in light, above a floor."""
    write(folder, grid(cloud()))
    return stage(folder, LIGHTS + FLOOR + volume_text(bound="/Look") + LOOK)


def fire(folder: Path) -> str:
    """A fire by Storm's convention: density and emission, above a floor."""
    write(folder, grid(0.1 * cloud()), grid(0.3 * cloud()[:, None] * (1.0, 0.5, 0.1), name="emission", kind="vec3s"))
    return stage(folder, FLOOR + volume_text({"density": "", "emission": ""}), "fire.usda")


def render(path: str, **values: Any) -> Image:
    changes: dict[str, Any] = {"resolution": SIZE, "spp": SPP, "seed": 3, "threads": 2} | values
    return primray.render(path, progress=False, **changes)


@pytest.mark.parametrize("make", [smoke, fire])
@pytest.mark.parametrize("changes", [{}, {"clamp_indirect": 0.2}, {"spp": 64}], ids=["plain", "clamped", "more"])
def test_expressions_add_up_to_the_picture(tmp_path: Path, make: Any, changes: dict[str, Any]) -> None:
    image = render(make(tmp_path), aovs=(*EVENTS, "C.*", "C.*L", "C.*O", "C<V>L"), **changes)
    whole = image.pixels[..., :3]
    for names in (EVENTS, ("C.*L", "C.*O"), ("C.*",)):
        total = np.sum([image.aovs[name].values for name in names], axis=0, dtype=np.float64)
        assert np.array_equal(total.astype(np.float32), whole), names
    assert (image.aovs["CV.+[LO]"].values.sum() > 0) or make is fire
    if make is smoke:
        assert image.aovs["C<V>L"].values.sum() > 0
        assert image.aovs["CO"].values.sum() == 0
    else:
        assert image.aovs["CO"].values.sum() > 0
        assert image.aovs["C<RD>[LO]"].values.sum() > 0
        assert image.aovs["C.*L"].values.sum() == 0


def test_alpha_is_what_smoke_covers(tmp_path: Path) -> None:
    """1 - T of smoke over nothing, where light is scattered as well; flames alone cover nothing."""
    write(tmp_path, grid(0.5))
    image = render(stage(tmp_path, LIGHTS + volume_text(bound="/Look") + LOOK), spp=1024, resolution=(48, 32))
    middle = image.pixels[14:18, 22:26, 3]
    assert middle.mean() == pytest.approx(1 - math.exp(-0.4 * 0.5 * 8), abs=0.02)
    assert image.pixels[0, 0, 3] == 0.0
    write(tmp_path, grid((1.0, 0.5, 0.1), name="emission", kind="vec3s"))
    flames = render(stage(tmp_path, volume_text({"emission": ""}), "flames.usda"))
    assert flames.pixels[..., :3].max() > 1.0
    assert (flames.pixels[..., 3] == 0.0).all()


@pytest.mark.parametrize("make", [smoke, fire])
@pytest.mark.parametrize("changes", [{}, {"clamp_indirect": 0.1}], ids=["plain", "clamped"])
def test_a_pixel_is_the_sum_of_its_log(tmp_path: Path, make: Any, changes: dict[str, Any]) -> None:
    path = make(tmp_path)
    image = render(path, filter="box", **changes)
    for x, y in ((11, 8), (12, 13)):
        log = primray.debug_pixel(path, x, y, resolution=SIZE, filter="box", spp=SPP, seed=3, **changes)
        for sample in log.samples:
            total = sum((np.array(e.get("contribution", (0, 0, 0))) for e in sample["events"]), np.zeros(3))
            np.testing.assert_allclose(total - sample.get("clamped", (0, 0, 0)), sample["value"], rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose([*log.value, log.alpha], image.pixels[y, x], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("make", [smoke, fire])
def test_a_clamp_leaves_direct_light_alone(tmp_path: Path, make: Any) -> None:
    path = make(tmp_path)
    direct = render(path, max_depth=1)
    np.testing.assert_array_equal(direct.pixels, render(path, max_depth=1, clamp_indirect=1e-3).pixels)
    assert render(path, clamp_indirect=1e-3).pixels.sum() < render(path).pixels.sum()


@pytest.mark.parametrize("name", ["volumes", "crowd of volumes"])
@pytest.mark.parametrize("splits", [(1, 1), (4, 1), (2, 3)], ids=["plain", "split", "more light samples"])
def test_ranges_of_samples_add_up(name: str, splits: tuple[int, int]) -> None:
    """Two ranges, merged, and a range that goes on where the first ended, have the bits of one render."""

    def rendered(film: core.Film, end: int) -> None:
        core.render_pass(scene(name), film, core.uniform_ends(film, end), core.Splits(*splits), settings(spp=24))

    whole, first, second, resumed = (core.Film(scene(name)) for _ in range(4))
    rendered(whole, 24)
    rendered(first, 10)
    rendered(resumed, 10)
    rendered(resumed, 24)
    second.start_at(5)
    rendered(second, 24)
    first.merge(second)
    for film in (first, resumed):
        for ours, theirs in zip(film.image(), whole.image(), strict=True):
            np.testing.assert_array_equal(ours, theirs)
