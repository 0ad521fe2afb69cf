"""What of a dome is sampled as a light: a sun, and not the brighter half of the sky that rays find anyway."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.described import Described, describe, ground, kernels, lambert, light, look_at, perspective, render, replicate_means
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import LightType

ROWS, COLUMNS = 128, 256
SUN_ROWS, SUN_COLUMNS = slice(30, 33), slice(100, 103)


def sky(sun: float) -> Any:
    """From 0.6 at the bottom to 1.4 at the top; a sun of four degrees."""
    image = np.broadcast_to(np.linspace(1.4, 0.6, ROWS)[:, None, None], (ROWS, COLUMNS, 3)).astype(np.float32).copy()
    image[SUN_ROWS, SUN_COLUMNS] = sun
    return image


def lit_by(image: Any) -> Described:
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    return describe([(ground(6.0), np.eye(4))], [lambert(0.5)], [light(LightType.DOME)], camera, (32, 32), dome_texture=image)


def test_light_samples_go_to_the_sun_alone() -> None:
    scene = lit_by(sky(sun=120.0)).build()
    n = 4000
    _, _, pdf, L = kernels().light_sample(scene, 0, np.zeros((n, 3)), random_numbers(n, 2, seed=3))
    assert (pdf > 0).all()
    assert (L[:, 0] > 1.4).mean() > 0.9  # the rest is at its edges; 0.36 where the sky's mean is left to rays
    w = np.random.default_rng(5).normal(size=(20_000, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    density, radiance = kernels().dome_eval(scene, 0, w.astype(np.float32))
    assert (density[radiance[:, 0] < 1.4] > 0).mean() < 0.001
    assert (density[radiance[:, 0] > 12.0] > 0).all()


def test_a_sky_without_a_sun_is_left_to_rays() -> None:
    scene = lit_by(sky(sun=1.2)).build()
    density, _ = kernels().dome_eval(scene, 0, np.eye(3, dtype=np.float32))
    assert (density == 0).all()


def test_a_weak_sun_leaves_open_ground_smooth() -> None:
    film = render(lit_by(sky(sun=120.0)).build(), 64, max_depth=1, splits=2)
    halves = replicate_means(film)
    noise = (halves[0] - halves[1]).std() / 2 / halves.mean()
    assert noise < 0.009  # 0.0064 when this was written; 0.0114 where the sky's mean is left to rays
