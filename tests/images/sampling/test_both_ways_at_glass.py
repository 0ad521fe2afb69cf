"""Paths follow both directions at the first smooth glass: what it mirrors is as certain as what is seen through it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    ground,
    lambert,
    light,
    look_at,
    perspective,
    render,
    replicate_means,
    rotation,
    translation,
)

from primray.description import Doubles, Light, LightType, Shape, Sphere, Surface

UPRIGHT = rotation((1, 0, 0), 90)
PANE = Surface("/pane", opacity=0.0, roughness=0.0, ior=1.5, thin=True, diffuse_color=(1, 1, 1))
BODY = Surface("/body", opacity=0.0, roughness=0.0, ior=1.5, diffuse_color=(1, 1, 1))
F0 = 0.04  # ((1.5 - 1) / (1.5 + 1))^2
SKY = light(LightType.DOME, np.eye(4), 1.0)


def seen(surface: Surface, behind: bool, lamp: Light = SKY) -> Described:
    """A pane or a body that fills the picture, in a white sky, before a black wall or nothing."""
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(50.0, 0) if surface.thin else Sphere("/ball", 100.0, 0), UPRIGHT if surface.thin else translation(0, 0, -100))
    ]
    if behind:
        shapes.append((ground(500.0, 1), translation(0, 0, -300) @ UPRIGHT))
    return describe(shapes, [surface, lambert(0.0)], [lamp], perspective(look_at([0, 0, 6], [0, 0, 0]), 0.02), (8, 8))


@pytest.mark.parametrize("splits", [1, 4])
@pytest.mark.parametrize("surface", [PANE, BODY], ids=["pane", "body"])
def test_what_it_mirrors_is_not_left_to_chance(surface: Surface, splits: int) -> None:
    """The reflected sky alone, as the wall is black: the same in each sample."""
    halves = replicate_means(render(seen(surface, behind=True).build(), 2, max_depth=1, splits=splits, light_samples=1))
    np.testing.assert_allclose(halves, F0, rtol=2e-3)


def test_the_alpha_of_a_pane_is_not_left_to_chance() -> None:
    """Before nothing, in a picture without a sky, a pane covers what it mirrors."""
    lamp = light(LightType.SPHERE, translation(30, 0, 3), 1.0, radius=0.5)
    film = render(seen(PANE, behind=False, lamp=lamp).build(), 1, max_depth=3, splits=1, light_samples=1)
    np.testing.assert_allclose(film.pixels()[..., 3], F0, rtol=2e-3)


def test_behind_the_first_one_it_is_left_to_chance() -> None:
    """A second sheet mirrors by chance, with the same mean: paths double once."""
    shapes: list[tuple[Shape, Doubles]] = [(ground(50.0, 0), translation(0, 0, -2.0 * k) @ UPRIGHT) for k in range(2)]
    shapes.append((ground(500.0, 1), translation(0, 0, -300) @ UPRIGHT))
    camera = perspective(look_at([0, 0, 6], [0, 0, 0]), 0.02)
    scene = describe(shapes, [PANE, lambert(0.0)], [SKY], camera, (16, 16)).build()
    halves = np.concatenate([replicate_means(render(scene, 64, max_depth=12, seed=s, splits=1)) for s in range(4)])
    assert halves.std() > 1e-3
    assert halves.mean() == pytest.approx(2 * F0 / (1 + F0), rel=0.01)  # of two sheets, with what goes to and fro between them
