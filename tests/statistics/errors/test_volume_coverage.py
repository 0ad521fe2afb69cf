"""Intervals of the error hold the truth with volumes: a cloud under sun and sky, a lamp in fog, a fire, colored smoke."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from tests.described import describe, ground, lambert, light, look_at, perspective, rotation, translation
from tests.images.volumes.voxels import block, glow, medium, voxels
from tests.statistics.errors.calibration import Case
from tests.statistics.errors.test_error_coverage import study

from primray import core
from primray.description import LightType
from primray.sampling.error import ALL_PIXELS
from primray.settings import RenderSettings

RESOLUTION = (32, 24)
REFERENCE_SPP = 1 << 11
CAMERA = perspective(look_at((6, 10, 40), (0, 0, 0)), 0.35, RESOLUTION[0] / RESOLUTION[1])
CLOUD = voxels(np.random.default_rng(7).random((16, 16, 16)) ** 2, (-8, -8, -8))
FLOOR = (ground(40), translation(0, -10, 0))
SUN = light(LightType.DISTANT, rotation((1, 0.3, 0), -50), 3.0)


def cloud() -> Any:
    sky = light(LightType.DOME, emission=(0.3, 0.4, 0.6))
    return {"media": [medium(CLOUD, 0.4, 0.95, anisotropy=0.6)], "lights": [SUN, sky]}


def fog() -> Any:
    lamp = light(LightType.POINT, translation(2, 3, 0), 100.0)
    return {"media": [medium(block(1.0, 40, first=(-20, -20, -20)), 0.02, 0.9)], "lights": [lamp]}


def fire() -> Any:
    return {"media": [medium(CLOUD, 0.1, 0.2)], "volume_emissions": [glow(CLOUD, (1.0, 0.4, 0.1))]}


def colored() -> Any:
    return {"media": [medium(CLOUD, (0.6, 0.3, 0.1), (0.5, 0.8, 0.9), anisotropy=-0.3)], "lights": [SUN]}


@cache
def case(make: Any) -> Case:
    scene = describe(shapes=[FLOOR], surfaces=[lambert(0.6)], camera=CAMERA, resolution=RESOLUTION, **make()).build()
    built = core.CoreScene(scene, 1.0, [], RESOLUTION)
    settings = RenderSettings(resolution=RESOLUTION, max_depth=6, filter="box", filter_width=1.0, threads=2)
    film = core.Film(built)
    ends = core.uniform_ends(film, REFERENCE_SPP)
    core.render_pass(built, film, ends, core.choose_splits(built, settings), replace(settings, seed=2**31))
    sums = film.error_sums(ALL_PIXELS, 2)
    pixels = film.pixels[..., :3].astype(np.float64)
    return Case(built, settings, pixels, sums.relative / sums.values, sums.squared / sums.values)


@pytest.mark.parametrize("make", [cloud, fog, fire, colored])
def test_a_few_renders(make: Any) -> None:
    """25 of 30 and more: at 95 % fewer come by chance once in 800 cells."""
    cell = study(case(make), 32, 30)
    assert cell["coverage"] >= 25 / 30, cell
    assert cell["ratio"] == pytest.approx(1, abs=0.08 + cell["two_standard_errors"]), cell


@pytest.mark.long
@pytest.mark.parametrize("spp", [16, 64, 256])
@pytest.mark.parametrize("make", [cloud, fog, fire, colored])
def test_many_renders(make: Any, spp: int) -> None:
    cell = study(case(make), spp, 200)
    print(make.__name__, cell)
    assert cell["coverage"] >= 0.87, cell
