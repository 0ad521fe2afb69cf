"""Choosing among many lights by their tree: probabilities, found again and in every lane; what may and what must be chosen."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import (
    describe,
    ground,
    kernels,
    lambert,
    light,
    look_at,
    orthographic,
    render,
    rotation,
    scaling,
    translation,
)
from tests.statistics.lights.placed_lights import LIGHTS, SHEAR
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import Doubles, Light, LightType

Floats = npt.NDArray[np.float32]
KINDS = (LightType.SPHERE, LightType.DISK, LightType.RECT, LightType.CYLINDER, LightType.POINT)
SIZES = {"radius": 0.05, "width": 0.1, "height": 0.06, "length": 0.3}


def mixed(count: int, seed: int = 0, spread: float = 3.0) -> list[Light]:
    """Of all kinds, turned anyhow, some sheared, of power between 1 and 10^4."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(count):
        m = translation(*rng.uniform(-spread, spread, 3)) @ rotation(rng.normal(size=3), float(rng.uniform(0, 360)))
        m = m @ (SHEAR if k % 7 == 0 else scaling(1, 1, 1))
        made.append(light(KINDS[k % len(KINDS)], m, float(10 ** rng.uniform(0, 4)), **SIZES))
    return made


def unit(count: int, seed: int) -> Floats:
    n = np.random.default_rng(seed).normal(size=(count, 3))
    return (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)


def scene_of(lights: list[Light]) -> object:
    return describe(lights=lights).build()


@pytest.mark.parametrize("count", [4, 17, 65, 200, 3000])
def test_probabilities_sum_to_one(count: int) -> None:
    lights = [x for x in mixed(3 * count) if x.type not in (LightType.DISK, LightType.RECT)]
    scene = scene_of([*lights[: count - 2], LIGHTS["sun"], LIGHTS["distant 180"]])
    points, around = np.random.default_rng(1).normal(size=(64, 3)) * 3, np.zeros((64, 3), np.float32)
    total = kernels().light_probabilities(scene, points, around).astype(np.float64).sum(axis=1)
    np.testing.assert_allclose(total, 1, atol=1e-4)


@pytest.mark.parametrize("count", [17, 65, 200, 3000])
def test_little_is_lost_on_clusters_that_do_not_reach(count: int) -> None:
    """Some of their lights look this way, or are above the surface, but then not those that are left at the end."""
    scene = scene_of([*mixed(count - 1), LIGHTS["distant 180"]])
    points = np.random.default_rng(1).normal(size=(256, 3)) * 3
    for n in (np.zeros((256, 3), np.float32), unit(256, 2)):
        total = kernels().light_probabilities(scene, points, n).astype(np.float64).sum(axis=1)
        assert (total < 1 + 1e-4).all()
        assert total.mean() > 0.95


@pytest.mark.parametrize("count", [4, 17, 65, 1000])
def test_the_probability_is_found_again(count: int) -> None:
    """From a light up as from the root down, and as often as it says."""
    scene = scene_of([*mixed(count - 1, seed=count), LIGHTS["sun"]])
    points, normals, n = np.random.default_rng(3).normal(size=(4, 3)) * 3, unit(4, 4), 40_000
    again = kernels().light_probabilities(scene, points, normals).astype(np.float64)
    for k in range(4):
        u = random_numbers(n, 1, seed=k).ravel()
        number, p = kernels().choose_light(scene, np.tile(points[k], (n, 1)), np.tile(normals[k], (n, 1)), u)
        chosen = p > 0
        np.testing.assert_allclose(p[chosen], again[k][number[chosen]], rtol=2e-6)
        assert chosen.mean() > again[k].sum() - 1e-3
        share = np.bincount(number[chosen], minlength=count) / n
        assert (np.abs(share - again[k]) <= 5 * np.sqrt(again[k] * (1 - again[k]) / n) + 1e-4).all()


@pytest.mark.parametrize("count", [5, 30, 400])
def test_no_light_that_reaches_a_surface_is_left_out(count: int) -> None:
    lights = mixed(count, seed=5, spread=1.0)
    scene = scene_of(lights)
    points, normals = np.random.default_rng(6).normal(size=(200, 3)), unit(200, 7)
    probability = kernels().light_probabilities(scene, points, normals)
    for i in range(count):
        for seed in range(3):
            wi, _, pdf, _ = kernels().light_sample(scene, i, points, random_numbers(200, 2, seed=seed))
            # Above the horizon by more than rounding.
            reached = (pdf > 0) & ((wi * normals).sum(axis=1) > 1e-5)
            assert (probability[:, i][reached] > 0).all(), lights[i].type


def test_lights_behind_are_not_chosen() -> None:
    """Below the surface's horizon, and those that look away."""
    rng = np.random.default_rng(8)
    up, down = rotation([1, 0, 0], 90), rotation([1, 0, 0], -90)  # where -z goes
    below = [light(LightType.SPHERE, translation(*rng.uniform([-1, -2, -1], [1, -0.2, 1])), radius=0.05) for _ in range(40)]
    away = [
        light(LightType.RECT, translation(*rng.uniform([-1, 0.5, -1], [1, 2, 1])) @ up, width=0.1, height=0.1)
        for _ in range(40)
    ]
    useful = [
        light(LightType.RECT, translation(*rng.uniform([-1, 0.5, -1], [1, 2, 1])) @ down, 1e-3, width=0.1, height=0.1)
        for _ in range(4)
    ]
    scene = scene_of([*below, *away, *useful])
    p = kernels().light_probabilities(scene, np.zeros((1, 3)), np.array([[0, 1, 0]], np.float32))[0].astype(np.float64)
    assert p[:80].sum() == 0
    np.testing.assert_allclose(p[80:].sum(), 1, atol=1e-6)
    nothing = kernels().light_probabilities(scene, np.array([[0.0, -9, 0]]), np.array([[0, -1, 0]], np.float32))[0]
    assert nothing.sum() == 0


def test_choices_are_good() -> None:
    """Among small lights the probability is close to the light's share of the irradiance."""
    rng = np.random.default_rng(9)
    count = 2000
    at = rng.uniform([-5, 0.5, -5], [5, 3, 5], (count, 3))
    power = np.exp(rng.normal(size=count))
    scene = scene_of([light(LightType.POINT, translation(*p), float(w)) for p, w in zip(at, power, strict=True)])
    points = np.zeros((40, 3))
    points[:, [0, 2]] = rng.uniform(-5, 5, (40, 2))
    up = np.tile(np.array([[0, 1, 0]], np.float32), (40, 1))
    probability = kernels().light_probabilities(scene, points, up).astype(np.float64)
    to = at[None] - points[:, None]
    brought = power * to[..., 1] / np.linalg.norm(to, axis=2) ** 3
    # The relative variance of one choice's estimate: sum of brought^2 / probability over the square of the whole.
    variance = (brought**2 / probability).sum(axis=1) / brought.sum(axis=1) ** 2 - 1
    assert np.median(variance) < 0.25
    by_power = (brought**2 / (power / power.sum())).sum(axis=1) / brought.sum(axis=1) ** 2 - 1
    assert np.median(by_power / variance) > 20


def test_choices_are_good_where_the_surface_cuts_clusters() -> None:
    """A light at hand counts although most of its cluster lies below the surface."""
    rng = np.random.default_rng(20)
    count = 1000
    at, power = rng.uniform(-5, 5, (count, 3)), np.exp(rng.normal(size=count))
    scene = scene_of([light(LightType.POINT, translation(*p), float(w)) for p, w in zip(at, power, strict=True)])
    points, normals = rng.uniform(-4, 4, (400, 3)), unit(400, 21)
    probability = kernels().light_probabilities(scene, points, normals).astype(np.float64)
    to = at[None] - points[:, None]
    distance = np.linalg.norm(to, axis=2)
    brought = power * np.maximum((to * normals[:, None]).sum(axis=2), 0) / distance**3
    some = np.maximum(probability, 1e-30)
    variance = (brought**2 / some).sum(axis=1) / brought.sum(axis=1) ** 2 - 1
    assert np.median(variance) < 0.05
    assert variance.mean() < 0.08
    assert variance.max() < 1


@pytest.mark.parametrize("emission", [0.0, 1e-30, 1e30])
def test_dark_and_bright_lights(emission: float) -> None:
    lights = [replace(x, emission=(emission, emission, emission)) if k % 2 else x for k, x in enumerate(mixed(60, seed=10))]
    scene = scene_of(lights)
    points, around = np.random.default_rng(11).normal(size=(50, 3)), np.zeros((50, 3), np.float32)
    p = kernels().light_probabilities(scene, points, around).astype(np.float64)
    assert np.isfinite(p).all()
    np.testing.assert_allclose(p.sum(axis=1), 1, atol=0.02)


@pytest.mark.parametrize("far", [1e4, 1e7])
def test_far_lights(far: float) -> None:
    """A crowd that is far away, and one small light at hand."""
    crowd = [replace(x, world_from_light=translation(far, 0, 0) @ x.world_from_light) for x in mixed(100, seed=12)]
    at_hand = light(LightType.SPHERE, translation(0, 1, 0), 1e3, radius=0.1)
    scene = scene_of([*crowd, at_hand])
    p = kernels().light_probabilities(scene, np.zeros((1, 3)), np.array([[0, 1, 0]], np.float32))[0]
    assert p[-1] > 0.99
    p = kernels().light_probabilities(scene, np.array([[far, 0, 0.0]]), np.array([[0, 1, 0]], np.float32))[0]
    assert p[-1] < 0.01
    assert np.isfinite(p).all()


def test_suns_beside_the_tree() -> None:
    """They are weighed against all other lights together: by day the sun, close to the lamps those."""
    sun = light(LightType.DISTANT, rotation([1, 0, 0], -60), 1e3, angle_deg=0.5)
    scene = scene_of([*mixed(100, seed=13, spread=0.5), sun])
    up = np.array([[0, 1, 0]], np.float32)
    assert kernels().light_probabilities(scene, np.array([[0.0, -9e4, 0]]), up)[0, -1] > 0.9
    assert kernels().light_probabilities(scene, np.array([[0.0, -0.2, 0]]), up)[0, -1] < 0.5


def test_lanes_choose_the_same() -> None:
    scene = scene_of(mixed(500, seed=14))
    points, n = np.random.default_rng(15).normal(size=(97, 3)), unit(97, 16)
    u = random_numbers(97, 1, seed=17).ravel()
    one, most = (kernels().choose_light(scene, points, n, u, lanes=lanes) for lanes in (1, 0))
    for a, b in zip(one, most, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("radius", [0.005, 0.3])
def test_the_whole_is_the_sum_of_parts_that_are_weighed_one_by_one(radius: float) -> None:
    """Small lights are left to light sampling alone, large ones share with scattered rays: both ways, nothing twice."""
    rng = np.random.default_rng(18)
    camera = orthographic(look_at([0, 0.01, 0], [0, 0, 0], up=(0, 0, -1)), 1.0, clipping_range=(1e-4, 1.0))
    # Floating, some halfway in the ground.
    at = rng.uniform([-1.5, 0.2 * radius, -1.5], [1.5, 1, 1.5], (48, 3))
    lights = [light(LightType.SPHERE, translation(*p), 0.01 / radius**2, radius=radius) for p in at]

    def image(some: list[Light]) -> Doubles:
        d = describe([(ground(3), np.eye(4))], [lambert(0.8)], some, camera, (8, 8))
        return np.asarray(render(d.build(), 2048, max_depth=1).pixels(1.0)[..., :3], np.float64)

    together, apart = image(lights), sum(image(lights[k : k + 3]) for k in range(0, 48, 3))
    np.testing.assert_allclose(together.mean(), np.mean(apart), rtol=4e-3)
    np.testing.assert_allclose(together, apart, rtol=0.1)


@pytest.mark.long
def test_building_takes_n_log_n() -> None:
    """Sixteen times the lights take less than thirty times as long."""
    rng = np.random.default_rng(19)
    seconds = []
    for count in (8_000, 128_000):
        d = describe(lights=[light(LightType.POINT, translation(*p)) for p in rng.normal(size=(count, 3))])
        times = []
        for _ in range(3):
            start = time.process_time()
            d.build()
            times.append(time.process_time() - start)
        seconds.append(min(times))
    assert seconds[1] < 30 * seconds[0] + 0.1
