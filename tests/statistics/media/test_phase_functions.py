"""Phase functions: their values, that they are normalised, that sampling has their density, and droplets in pictures."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import (
    box,
    describe,
    kernels,
    lambert,
    light,
    look_at,
    orthographic,
    perspective,
    quad,
    render,
    translation,
)
from tests.images.volumes.voxels import block, medium, voxels
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.media.phases import DROPLETS, draine, droplets, lobes
from tests.statistics.media.scenes import HERE, SKY, SUN_DIRECTION, mean, sun, volume
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import Fog, LightType

N = 400_000
DIAMETERS = (0.03, 0.1, 0.3, 1.0, 1.4, 1.5, 3.0, 4.99, 5.0, 12.0, 20.0, 50.0)
SIGNIFICANCE = 0.01 / 20  # Bonferroni: 1 % over the chi-square tests of this file
Array = npt.NDArray[Any]


def pairs(first: Any, second: Any = 0.0) -> Array:
    return np.stack(np.broadcast_arrays(np.asarray(first, np.float32), np.asarray(second, np.float32)), axis=1)


def dyadic_panels() -> list[Array]:
    """Values of 1 - cosine, exact in single precision: 1025 even ones in each panel, which double in size from the peak on."""
    first = 2.0**-14
    return [np.linspace(0, first, 1025), *(np.linspace(first * 2**k, first * 2 ** (k + 1), 1025) for k in range(15))]


def simpson(panels: list[Array], density: Any) -> float:
    """Return the integral over the sphere of a function of 1 - cosine."""
    total = 0.0
    for v in panels:
        f = np.asarray(density(v), np.float64)
        total += (v[1] - v[0]) / 3 * float(f[0] + f[-1] + 4 * f[1:-1:2].sum() + 2 * f[2:-1:2].sum())
    return 2 * math.pi * total


@pytest.mark.parametrize("d", DIAMETERS)
def test_the_fits_are_those_of_the_paper(d: float) -> None:
    found = kernels().droplet_lobes(pairs([DROPLETS + d]))[0]
    np.testing.assert_allclose(found, lobes(float(np.float32(DROPLETS + d)) - DROPLETS), rtol=3e-6, atol=3e-6)


@pytest.mark.parametrize("phase", [0.0, 0.5, -0.6, *(DROPLETS + d for d in DIAMETERS)])
def test_they_are_normalised(phase: float) -> None:
    found = simpson(dyadic_panels(), lambda v: kernels().phase_density(pairs(1 - v, phase)))
    assert found == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("d", DIAMETERS)
def test_densities_are_those_of_the_paper(d: float) -> None:
    v = np.concatenate(dyadic_panels())
    found = kernels().phase_density(pairs(1 - v, DROPLETS + d))
    np.testing.assert_allclose(found, droplets(1 - v, float(np.float32(DROPLETS + d)) - DROPLETS), rtol=2e-4)


@pytest.mark.parametrize("d", DIAMETERS)
def test_samples_have_the_density(d: float) -> None:
    phase = DROPLETS + d
    w = kernels().sample_phase(random_numbers(N, 2, seed=3), phase)
    cells = SphereCells((0, 0, 1), growth=5.0, rings=40)
    assert density_p_value(cells, lambda at: droplets(np.minimum(at[:, 2], 1.0), d), w, N) > SIGNIFICANCE
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1, atol=1e-6)


def test_a_wrong_density_is_noticed() -> None:
    w = kernels().sample_phase(random_numbers(N, 2, seed=3), DROPLETS + 20)
    cells = SphereCells((0, 0, 1), growth=5.0, rings=40)
    assert density_p_value(cells, lambda at: droplets(np.minimum(at[:, 2], 1.0), 19.0), w, N) < SIGNIFICANCE


@pytest.mark.parametrize("phase", [0.7, *(DROPLETS + d for d in DIAMETERS)])
def test_mean_cosines(phase: float) -> None:
    found = float(kernels().mean_cosine(pairs([phase]))[0])
    panels = dyadic_panels()
    assert found == pytest.approx(simpson(panels, lambda v: (1 - v) * kernels().phase_density(pairs(1 - v, phase))), abs=1e-5)
    cosines = kernels().sample_phase(random_numbers(N, 2, seed=5), phase)[:, 2].astype(np.float64)
    assert cosines.mean() == pytest.approx(found, abs=5 * cosines.std() / math.sqrt(N))


@pytest.mark.parametrize("alpha", [0.0, 1.0, 20.0, 250.0])
@pytest.mark.parametrize("g", [-0.04, 0.0, 1e-4, 0.02, 0.4, 0.72, 0.95])
def test_draines_function_is_inverted_exactly(g: float, alpha: float) -> None:
    """The integral of the density from straight ahead to the sample is the random number."""
    u = np.concatenate([(np.arange(1000) + 0.5) / 1000, [0.0, 1e-6, 1e-4, 0.9999, 0.999999]])
    found = kernels().sample_draine(pairs(u), g, alpha).astype(np.float64)
    assert ((found >= -1) & (found <= 1)).all()
    x, w = np.polynomial.legendre.leggauss(200)
    # The density is smooth in Henyey and Greenstein's sqrt(1 + g^2 - 2 g cosine).
    low, high = np.sqrt(1 + g * g - 2 * g * np.array((np.ones_like(found), found)))
    if abs(g) < 1e-3:
        c = found[:, None] + (1 - found)[:, None] * (x + 1) / 2
        integral = ((1 - found)[:, None] / 2 * w * 2 * math.pi * draine(c, g, alpha)).sum(axis=1)
    else:
        y = low[:, None] + (high - low)[:, None] * (x + 1) / 2
        c = (1 + g * g - y * y) / (2 * g)
        integral = ((high - low)[:, None] / 2 * w * 2 * math.pi * draine(c, g, alpha) * y / g).sum(axis=1)
    # Cosines are rounded to single precision.
    assert (np.abs(integral - u) <= 3e-6 + 4e-7 * 2 * math.pi * draine(found, g, alpha)).all()


def test_limits_of_draines_function() -> None:
    c = np.linspace(-1, 1, 201)
    for g in (0.0, 0.6, -0.3):
        np.testing.assert_array_equal(kernels().draine_density(pairs(c), g, 0.0), kernels().phase_density(pairs(c, g)))
        u = random_numbers(1000, 2, seed=1)
        flat = kernels().sample_phase(u, g)[:, 2]
        np.testing.assert_allclose(kernels().sample_draine(u, g, 0.0), flat, atol=2e-5)
    rayleigh = 3 / (16 * math.pi) * (1 + c * c)
    np.testing.assert_allclose(kernels().draine_density(pairs(c), 0.0, 1.0), rayleigh, rtol=1e-6)
    # The smallest droplets scatter almost as molecules do.
    np.testing.assert_allclose(kernels().phase_density(pairs(c, DROPLETS + 1e-3)), rayleigh, rtol=5e-3)


def test_henyey_and_greenstein_stay_as_they_were() -> None:
    """Bit by bit, whether or not other lanes have droplets."""
    one, k = np.float32(1), np.float32(0.0795774715)
    grid = np.meshgrid(np.linspace(-1, 1, 101, dtype=np.float32), np.array([-0.98, -0.3, 0, 0.5, 0.98], np.float32))
    c, g = (axis.ravel() for axis in grid)
    q: Array = np.maximum(one + g * g - np.float32(2) * g * c, np.float32(1e-12))
    expected = (one - g * g) * k / (q * np.sqrt(q))
    np.testing.assert_array_equal(kernels().phase_density(pairs(c, g)), expected)
    mixed = pairs(c, g)
    mixed[1::2, 1] = DROPLETS + 20
    np.testing.assert_array_equal(kernels().phase_density(mixed)[::2], expected[::2])


def test_lanes_change_no_bit() -> None:
    rng = np.random.default_rng(2)
    phases = np.where(rng.random(2000) < 0.5, rng.uniform(-0.98, 0.98, 2000), DROPLETS + 50 * rng.random(2000) ** 3)
    u, c = pairs(rng.random(2000), phases), pairs(rng.uniform(-1, 1, 2000), phases)
    np.testing.assert_array_equal(kernels().sample_phases(u, lanes=1), kernels().sample_phases(u))
    np.testing.assert_array_equal(kernels().phase_density(c, lanes=1), kernels().phase_density(c))


def mist(density: float = 0.3, diameter: float = 20.0, **values: Any) -> Fog:
    return Fog(path="/fog", density=density, droplets=diameter, **values)


@pytest.mark.parametrize("diameter", [0.05, 1.0, 3.0, 10.0, 50.0])
def test_a_white_furnace(diameter: float) -> None:
    """Droplets that absorb nothing cannot be seen in a white sky: in grids, in shapes and as fog."""
    camera = perspective(look_at((30, 12, 20), (3.5, 3.5, 3.5)), 0.3)
    smoke = [medium(block(), 0.5, 1.0, droplets=diameter), medium(block(), 0.2, 1.0, anisotropy=0.3)]
    pixels = render(describe(media=smoke, lights=[SKY], camera=camera, resolution=(16, 16)).build(), 64, splits=1).pixels()
    np.testing.assert_allclose(pixels[..., :3].mean(), 1.0, atol=1e-3)
    shape = [(box((4, 4, 2)), HERE)]
    np.testing.assert_allclose(mean(shape, [volume(1.5, droplets=diameter)], spp=1024)[:3], 1.0, atol=2e-3)
    ground = quad([[-900, 0, 900], [900, 0, 900], [900, 0, -900], [-900, 0, -900]], 0)
    down = orthographic(look_at((0, 5, 0), (0, 0, 0), (0, 0, 1)), 1e-3)
    found = mean([(ground, HERE)], [lambert(1.0)], [SKY], down, fog=mist(0.3, diameter, top=2.0), spp=1024)
    np.testing.assert_allclose(found[:3], 1.0, atol=3e-3)


@pytest.mark.parametrize("diameter", [0.05, 1.0, 5.0, 20.0])
def test_a_slab_scatters_the_sun_once(diameter: float) -> None:
    """The closed form of test_volumes.py: albedo p E (1 - exp(-s d (1 + 1 / mu0))) / (1 + 1 / mu0); p is 0.02 to 0.08 there."""
    wide, s, albedo = (box((400, 400, 2)), HERE), 0.6, 0.8
    along = 1 + 1 / SUN_DIRECTION[2]
    expected = albedo * droplets(-SUN_DIRECTION[2], diameter) * (1 - math.exp(-s * 2 * along)) / along
    found = mean([wide], [volume(s, albedo, droplets=diameter)], [sun()], spp=1024, max_depth=1)
    np.testing.assert_allclose(found[:3], expected, rtol=5e-3)


def airlight(places: Array, density: float, diameter: float) -> float:
    """Return the light of points of intensity 1 that endless fog of albedo 0.8 scatters once along -z from the origin."""
    total = 0.0
    for x, y, z in places:
        aside = math.hypot(x, y)
        low = math.atan2(z, aside)
        # Distances along the ray are -z + aside tan(angle), so that the inverse square is constant; angles crowd at the end,
        # where light is scattered forwards or backwards.
        part = (np.arange(40_000) + 0.5) / 40_000
        angle = low + (part * part * (3 - 2 * part)) * (math.pi / 2 - low)
        width = 6 * part * (1 - part) / 40_000 * (math.pi / 2 - low)
        t, r = -z + aside * np.tan(angle), aside / np.cos(angle)
        cosine = -(t + z) / r
        total += float((width * 0.8 * density * droplets(cosine, diameter) * np.exp(-density * (t + r))).sum() / aside)
    return total


@pytest.mark.parametrize(("count", "diameter"), [(1, 1.0), (1, 20.0), (60, 8.0)])
@pytest.mark.parametrize("is_fog", [True, False])
def test_the_airlight_of_points(count: int, diameter: float, is_fog: bool) -> None:
    """Light samples along rays and from the light tree, and phase samples, against quadrature: in fog and in a grid."""
    rng = np.random.default_rng(count)
    places = rng.uniform([-4, -4, -12], [4, 4, -2], (count, 3))
    places = places[np.hypot(places[:, 0], places[:, 1]) > 0.3]
    density, size = 0.1, 1e-3
    intensity = 1 / (math.pi * size**2)  # the radiance of a sphere of intensity 1
    lamps = [light(LightType.SPHERE, translation(*p), intensity, radius=size) for p in places]
    camera = orthographic(HERE, 1e-4, clipping_range=(0.0, 1e6))
    more: dict[str, Any] = {}
    if is_fog:
        more["fog"] = mist(density, diameter, albedo=(0.8, 0.8, 0.8))
        found = mean([], [], lamps, camera, spp=4096, max_depth=1, **more)[:3]
    else:
        # A grid so large that the light beyond it does not count.
        cloud = medium(voxels(np.ones((16, 16, 16))), density, 0.8, droplets=diameter, matrices=[
            translation(-300, -300, -300) @ np.diag([40.0, 40.0, 40.0, 1.0])
        ])  # fmt: skip
        scene = describe(media=[cloud], lights=lamps, camera=camera, resolution=(8, 8))
        found = render(scene.build(), 4096, max_depth=1).pixels()[..., :3].mean((0, 1))
    np.testing.assert_allclose(found, airlight(places, density, diameter), rtol=1.5e-2)


@pytest.mark.parametrize("kind", ["fog", "grid"])
def test_pictures_have_the_same_bits_at_any_lanes(kind: str) -> None:
    lamp = light(LightType.SPHERE, translation(1, 2, -3), 20.0, radius=0.2)
    ball = (box((1, 1, 1)), translation(0, 0, -6))
    camera = perspective(look_at((0, 0.5, 3), (0, 0, -6)), 0.4)
    smoke = [medium(block(), 0.2, 0.9, droplets=15.0, matrices=[translation(-4, -4, -9)])] if kind == "grid" else []
    made = describe([ball], [lambert(0.5)], [lamp], camera, media=smoke, resolution=(16, 16))
    if kind == "fog":
        made = replace(made, description=replace(made.description, fog=mist(0.1, 15.0, albedo=(0.9, 0.9, 0.9))))
    first, second = (render(made.build(), 8, lanes=lanes, splits=1).pixels() for lanes in (1, 0))
    np.testing.assert_array_equal(first, second)
