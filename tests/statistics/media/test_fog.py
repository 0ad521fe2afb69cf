"""Fog with a top and exponential falloff against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.described import box, lambert, light, look_at, orthographic, quad, translation
from tests.statistics.media.phases import henyey_greenstein
from tests.statistics.media.scenes import HERE, SKY, mean, sun, volume

from primray.description import Fog, LightType, OpenPbr, Sphere, Surface

FLOOR = (quad([[-50, 0, 50], [50, 0, 50], [50, 0, -50], [-50, 0, -50]], 0), HERE)
SHINES = lambert(0.0, 1.0)
BLACK = (0.0, 0.0, 0.0)


def fog(density: float = 0.3, **values: Any) -> Fog:
    return Fog(path="/fog", density=density, **values)


def column(low: float, high: float, top: float, falloff: float) -> float:
    """Integral of the density over heights, for density 1 below the top."""

    def up_to(h: float) -> float:
        return h - top if h <= top else falloff * (1 - math.exp(-(h - top) / falloff)) if falloff > 0 else 0.0

    return up_to(high) - up_to(low)


def seen_from(height: float, tilt_deg: float) -> Any:
    """An orthographic camera that looks `tilt_deg` above the horizon."""
    a = math.radians(tilt_deg)
    target = (0.0, height + math.sin(a), -math.cos(a))
    return orthographic(look_at((0, height, 0), target, (0, 0, -1) if abs(tilt_deg) > 80 else (0, 1, 0)), 1e-3)


@pytest.mark.parametrize("falloff", [0.0, 0.05, 1.5])
@pytest.mark.parametrize("height", [0.5, 1.999, 3.0, 8.0])
@pytest.mark.parametrize("tilt", [90.0, 30.0, 2.0, -3.0, -45.0, -90.0])
def test_it_absorbs_what_passes_its_profile(height: float, tilt: float, falloff: float) -> None:
    sine = math.sin(math.radians(tilt))
    depth = column(height, 1e9, 2.0, falloff) if sine > 0 else column(0.0, height, 2.0, falloff)
    expected = math.exp(-0.3 * depth / abs(sine))
    ground = [(quad([[-900, 0, 900], [900, 0, 900], [900, 0, -900], [-900, 0, -900]], 0), HERE)]
    lights = [SKY] if sine > 0 else []
    found = mean(ground, [SHINES], lights, seen_from(height, tilt), fog=fog(albedo=BLACK, top=2.0, falloff=falloff), spp=16)
    np.testing.assert_allclose(found[:3], expected, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("falloff", [0.0, 1.5])
@pytest.mark.parametrize(("height", "tilt"), [(0.5, 40.0), (5.0, -60.0), (2.0, 90.0)])
def test_scattering_without_absorption_keeps_a_white_sky_white(height: float, tilt: float, falloff: float) -> None:
    white = quad([[-900, 0, 900], [900, 0, 900], [900, 0, -900], [-900, 0, -900]], 0)
    made = fog(top=2.0, falloff=falloff, anisotropy=0.4)
    found = mean([(white, HERE)], [lambert(1.0)], [SKY], seen_from(height, tilt), fog=made, spp=1024)
    np.testing.assert_allclose(found[:3], 1.0, atol=3e-3)


def test_collisions_have_the_profiles_density() -> None:
    """Single scattering of the sun in layers of fog: by quadrature over heights."""
    mu0, g = 0.5, 0.3
    lights = [sun(towards=(0.0, mu0, math.sqrt(1 - mu0 * mu0)))]
    camera = orthographic(look_at((0, 30, 0), (0, 0, 0), (0, 0, 1)), 0.1)
    for falloff in (0.0, 1.0):
        h, w = np.polynomial.legendre.leggauss(4000)
        h, w = (h + 1) * 15, w * 15
        density = np.where(h <= 2, 1.0, np.exp(-(h - 2) / falloff) if falloff else 0.0)
        above = np.array([column(x, 1e9, 2.0, falloff) for x in h])
        expected = henyey_greenstein(-mu0, g) * float((w * 0.3 * density * np.exp(-0.3 * above * (1 + 1 / mu0))).sum())
        black = [FLOOR], [lambert(0.0)]
        made = fog(top=2.0, falloff=falloff, anisotropy=g)
        found = mean(*black, lights, camera, fog=made, spp=1024, max_depth=1)
        np.testing.assert_allclose(found[:3], expected, rtol=1.5e-2)


@pytest.mark.parametrize("albedo", [0.0, 1.0])
def test_it_emits_by_its_profile(albedo: float) -> None:
    made = fog(albedo=(albedo,) * 3, emission=(1.0, 2.0, 0.0), top=2.0, falloff=1.5)
    depth = column(1.0, 1e9, 2.0, 1.5)
    whole = (1 - math.exp(-0.3 * depth)) / 0.3
    up = seen_from(1.0, 90.0)
    if albedo == 0:
        np.testing.assert_allclose(mean([], [], [], up, fog=made)[:3], [whole, 2 * whole, 0.0], rtol=1e-4)
    else:
        once = mean([], [], [], up, fog=made, max_depth=0, spp=16)
        np.testing.assert_allclose(once[:3], [whole, 2 * whole, 0.0], rtol=1e-4)
    thin = fog(0.0, emission=(1.0, 2.0, 0.0), top=2.0, falloff=1.5)
    np.testing.assert_allclose(mean([], [], [], up, fog=thin)[:3], [depth, 2 * depth, 0.0], rtol=1e-4)


def test_fog_and_a_volume_in_it_add() -> None:
    """The camera looks down through a box in the fog: both absorb, and each emits through the other."""
    cube, shines = (box((4, 2, 4), 1), translation(0, 1.0, 0)), 0.7
    down = orthographic(look_at((0, 5, 0), (0, 0, 0), (0, 0, 1)), 0.1)
    s, f = 0.4, 0.3
    absorbed = mean([FLOOR, cube], [SHINES, volume(s, 0.0)], [], down, fog=fog(f, albedo=BLACK, top=2.0))
    np.testing.assert_allclose(absorbed[:3], math.exp(-2 * (s + f)), rtol=1e-4)
    glows = [lambert(0.0), volume(s, 0.0, emission=shines)]
    both = (shines + 0.2) * (1 - math.exp(-2 * (s + f))) / (s + f)
    for albedo in (0.0, 1.0):
        made = fog(f, albedo=(albedo,) * 3, emission=(0.2,) * 3, top=2.0)
        found = mean([FLOOR, cube], glows, [], down, fog=made, spp=4096, max_depth=0)
        np.testing.assert_allclose(found[:3], both, rtol=5e-3)


def test_glass_keeps_fog_out() -> None:
    lobes = OpenPbr(base_weight=0.0, specular_weight=0.0, specular_ior=1.0, transmission_weight=1.0)
    tank = [FLOOR, (box((4, 1.5, 4), 1), translation(0, 1.0, 0))]
    filled = Surface("/m", open_pbr=lobes, volume=volume(0.1, 0.0).volume)
    down = orthographic(look_at((0, 5, 0), (0, 0, 0), (0, 0, 1)), 0.1)
    found = mean(tank, [SHINES, filled], [], down, fog=fog(albedo=BLACK, top=2.0))
    np.testing.assert_allclose(found[:3], math.exp(-0.3 * 0.5 - 0.1 * 1.5), rtol=1e-4)


def test_far_from_the_origin_it_is_the_same() -> None:
    far, down = translation(1e6, 0, -1e6), orthographic(look_at((0, 5, 0), (0, 0, 0), (0, 0, 1)), 0.1)
    here = mean([FLOOR], [SHINES], [], down, fog=fog(albedo=BLACK, top=2.0, falloff=1.0))
    np.testing.assert_allclose(
        mean([FLOOR], [SHINES], [], down, fog=fog(albedo=BLACK, top=2.0, falloff=1.0), at=far), here, rtol=1e-3
    )


def test_fog_without_a_top_hides_the_sky() -> None:
    np.testing.assert_allclose(mean([], [], [SKY], fog=fog(albedo=BLACK)), [0, 0, 0, 1], atol=1e-6)


def test_alpha_is_what_fog_covers() -> None:
    expected = 1 - math.exp(-0.3 * column(1.0, 1e9, 2.0, 1.5))
    for albedo in (0.0, 1.0):
        made = fog(albedo=(albedo,) * 3, top=2.0, falloff=1.5)
        assert mean([], [], [], seen_from(1.0, 90.0), fog=made, spp=1024)[3] == pytest.approx(expected, abs=5e-3)


def test_lights_in_it_shine_through_it() -> None:
    lamp = light(LightType.SPHERE, translation(0, 1, -5), 2.0, radius=0.5)
    found = mean([], [], [lamp], orthographic(translation(0, 1, 0), 0.01), fog=fog(albedo=BLACK, top=3.0))
    np.testing.assert_allclose(found[:3], 2.0 * math.exp(-0.3 * 4.5), rtol=1e-3)
    ball = Sphere("/ball", 1.0, 0, ())
    assert mean([(ball, translation(0, 1, -5))], [SHINES], [], orthographic(translation(0, 1, 0), 0.01),
                fog=fog(albedo=BLACK, top=3.0))[0] == pytest.approx(math.exp(-0.3 * 4), rel=1e-3)  # fmt: skip
