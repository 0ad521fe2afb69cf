"""Lights chosen by how a shiny surface reflects: the same light, less noise, whatever shares its packet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    describe,
    ground,
    lambert,
    light,
    look_at,
    orthographic,
    render,
    replicate_means,
    rotation,
    translation,
)

from primray.description import Doubles, Light, LightType, Surface

# Straight down, below the lights.
VIEW = orthographic(look_at([0, 0.01, 0], [0, 0, 0], up=(0, 0, -1)), 1.0, clipping_range=(1e-4, 1.0))
METAL = Surface("/a", metallic=1.0, diffuse_color=(0.9, 0.8, 0.6))
SURFACES = {
    "smooth metal": replace(METAL, roughness=0.3),
    "rough metal": replace(METAL, roughness=0.5),
    "plastic": Surface("/a", roughness=0.3, diffuse_color=(0.5, 0.2, 0.2)),
    "coated": Surface("/a", roughness=0.4, clearcoat=1.0, clearcoat_roughness=0.2, diffuse_color=(0.3, 0.5, 0.2)),
}


def lamps() -> list[Light]:
    """Over the ground, of several kinds; one far away, and one that only light samples find."""
    down = rotation([1, 0, 0], -90)
    found = [light(LightType.SPHERE, translation(x, 0.8, z), 60.0, radius=0.06) for x in (-0.6, 0, 0.6) for z in (-0.4, 0.3)]
    found += [light(LightType.RECT, translation(x, 1.2, -0.1) @ down, 8.0, width=0.3, height=0.2) for x in (-0.8, 0.8)]
    found += [light(LightType.DISTANT, rotation([1, 0, 0], -50), 2.0, angle_deg=3.0)]
    return [*found, light(LightType.POINT, translation(0.3, 0.7, -0.1), 0.3)]


def image(surface: Surface, lights: list[Light], spp: int, seed: int = 0) -> Doubles:
    d = describe([(ground(3), np.eye(4))], [surface], lights, VIEW, (12, 12))
    return replicate_means(render(d.build(), spp, max_depth=1, seed=seed, threads=2).film)


@pytest.mark.parametrize("name", SURFACES)
def test_the_whole_is_the_sum_of_single_lights(name: str) -> None:
    """One light alone is not chosen."""
    surface, lights = SURFACES[name], lamps()
    whole = np.concatenate([image(surface, lights, 4096, seed) for seed in range(4)])
    parts = [np.concatenate([image(surface, [one], 1024, seed) for seed in range(4)]) for one in lights]
    expected = sum(p.mean(axis=0) for p in parts)
    error = np.sqrt((whole.var(axis=0) + sum(p.var(axis=0) for p in parts)) / 7)
    assert np.median(error / expected) < 0.01
    # Student's t with 7 degrees of freedom: 9 is exceeded by 1 of 20,000, of 432 values.
    assert (np.abs(whole.mean(axis=0) - expected) < 9 * error).all()
    assert abs(whole.mean() / expected.mean() - 1) < 2e-3


# At 16 samples; by the irradiance that lights bring alone they are 0.19, 0.027, 0.013 and 0.051.
@pytest.mark.parametrize(
    ("name", "most"), [("smooth metal", 0.06), ("rough metal", 0.016), ("plastic", 0.006), ("coated", 0.03)]
)
def test_lights_that_are_seen_reflected_are_chosen(name: str, most: float) -> None:
    means = np.stack([image(SURFACES[name], lamps(), 16, seed) for seed in range(16)])
    error = (means[:, 0] - means[:, 1]) ** 2 / (means.mean(axis=(0, 1)) ** 2 + 0.01)
    assert error.mean() < most, error.mean()


def test_neighbours_in_a_packet_show_in_no_bit() -> None:
    surfaces = [SURFACES["smooth metal"], lambert(0.5)]
    shapes = [(ground(0.7), translation(-0.7, 0, 0)), (ground(0.7, 1), translation(0.7, 0, 0))]
    d = describe(shapes, surfaces, lamps(), VIEW, (12, 12))
    one, many = (render(d.build(), 32, max_depth=3, lanes=lanes).film.replicates for lanes in (1, 0))
    np.testing.assert_array_equal(one, many)
