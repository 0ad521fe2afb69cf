"""Rays guided into caustics: the density is what is drawn and sums to one, and pictures keep their mean with less noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.described import (
    Described,
    describe,
    ground,
    kernels,
    lambert,
    light,
    look_at,
    perspective,
    render,
    replicate_means,
    translation,
)
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces import random_numbers

from primray.description import Doubles, LightType, Sphere, Surface

N = 40_000
GLASS = Surface("/glass", diffuse_color=(1, 1, 1), roughness=0.0, opacity=0.0, ior=1.5)
METAL = Surface("/metal", diffuse_color=(0.9, 0.8, 0.6), metallic=1.0, roughness=0.1)
HEIGHT = 1.2


def sky() -> Any:
    """Dim, but for a sun of two degrees, 50 degrees high."""
    image = np.full((128, 256, 3), 0.2, np.float32)
    image[28:30, 100:102] = 2000.0
    return image


def balls() -> Described:
    shapes = [
        (ground(6.0), np.eye(4)),
        (Sphere("/ball", 0.5, 1), translation(-0.7, 0.5, 0)),
        (Sphere("/other", 0.5, 2), translation(0.7, 0.5, 0)),
    ]
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    return describe(shapes, [lambert(0.5), GLASS, METAL], [light(LightType.DOME)], camera, (32, 32), dome_texture=sky())


def lit_points(scene: Any, count: int) -> Doubles:
    """Of a grid on the ground, those with the largest guided share."""
    at = np.stack(np.meshgrid(np.linspace(-3, 3, 160), [0.0], np.linspace(-3, 3, 160)), axis=-1).reshape(-1, 3)
    zero = np.zeros((len(at), 3), np.float32)
    share, *_ = kernels().caustic_lobes(scene, at, zero, zero)
    return at[np.argsort(-share)[:count]]


def test_samples_follow_the_density() -> None:
    scene = balls().build()
    assert kernels().caustic_photons(scene) > 1000
    for point in lit_points(scene, 40)[::20]:
        p = np.ascontiguousarray(np.broadcast_to(point, (N, 3)))
        u = random_numbers(N, 3, seed=5)
        share, wi, pdf, _ = kernels().caustic_lobes(scene, p, u, u)
        assert (share > 0.1).all()
        assert (share <= 0.5).all()
        assert (pdf > 0).all()

        def density(w: Doubles, at: Doubles = point) -> Doubles:
            there = np.ascontiguousarray(np.broadcast_to(at, (len(w), 3)))
            given = w.astype(np.float32)
            found: Doubles = kernels().caustic_lobes(scene, there, np.zeros_like(given), given)[3]
            return found

        toward = np.mean(wi, axis=0, dtype=np.float64)
        cells = SphereCells(toward / np.linalg.norm(toward), spread=np.pi, growth=3, rings=24, points=40)
        assert density_p_value(cells, density, wi, N) > 0.005


def test_pictures_keep_their_mean_and_lose_noise() -> None:
    guided, plain = balls().build(), balls().build()
    kernels().drop_caustics(plain)
    assert kernels().caustic_photons(plain) == 0
    means, noise = [], []
    for scene in (guided, plain):
        halves = np.concatenate([replicate_means(render(scene, 256, max_depth=6, seed=s, splits=1)) for s in range(4)])
        means.append(halves.mean(axis=(1, 2)))
        noise.append(halves.std(axis=0).mean())
    error = np.sqrt(sum(m.var(axis=0, ddof=1) / len(m) for m in means))
    assert (np.abs(means[0].mean(axis=0) - means[1].mean(axis=0)) < 4 * error).all()
    assert noise[0] < 0.8 * noise[1]  # 0.65 when this was written
