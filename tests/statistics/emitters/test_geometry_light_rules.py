"""Shapes that are lights have the rules of other lights: linking, shadow linking, ShadowAPI."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import box, describe, ground, perspective, quad, render, replicate_means, rotation, scaling, translation
from tests.statistics.emitters.test_geometry_lights import (
    DARK,
    LAMP_SURFACE,
    SURFACES,
    assert_same,
    below,
    irradiance,
    lamp_quad,
    wears,
)
from tests.statistics.lights.test_light_rules import FREE, MIRROR, ONE_OUT, TINT, TWO, facing, roof

from primray.description import Doubles, Linked, Shadow, Shape, Sphere, Surface

LAMPS: dict[str, tuple[Any, Doubles]] = {
    "quad": (lamp_quad(), np.eye(4)),
    "box": (box([0.4, 0.3, 0.5]), translation(0.1, 1.2, 0) @ rotation([1, 1, 0], 30)),
    "sphere": (Sphere("/s", 0.3, 0), translation(0.2, 1.1, 0.1)),
    "ellipsoid": (Sphere("/s", 0.3, 0), translation(0.2, 1.1, 0.1) @ scaling(1.4, 0.6, 1)),
}


def lamp(name: str, emission: Any = 2.0, **rules: Any) -> tuple[Shape, Doubles]:
    shape, matrix = LAMPS[name]
    return wears(shape, emission, LAMP_SURFACE, own_color=True, shows_own=True, **rules), matrix


def linked(d: Any, table: Linked) -> Any:
    return replace(d, description=replace(d.description, linked=table))


@pytest.mark.parametrize("why", FREE)
@pytest.mark.parametrize("name", LAMPS)
def test_under_a_roof_that_casts_no_shadow(name: str, why: str) -> None:
    """As bright as without it; and a body hides its own far side, which is no shadow."""
    plain = irradiance(below([lamp(name)]), 256)
    screen = roof(0.4, DARK, row=1)
    rules = {"shadow": Shadow(distance=0.2)} if why == "out of reach" else FREE[why]
    found = irradiance(linked(below([lamp(name, **rules), (screen, np.eye(4))]), ONE_OUT), 256)
    assert_same(found, plain)
    assert plain[0] > 0.1


@pytest.mark.parametrize("name", LAMPS)
def test_shadow_color(name: str) -> None:
    plain = irradiance(below([lamp(name)]), 256)
    tinted = irradiance(below([lamp(name, shadow=Shadow(color=TINT)), (roof(0.4, DARK), np.eye(4))]), 256)
    assert_same(tinted, (plain[0] * TINT[1], plain[1]))
    covered = below([lamp(name, shadow_link=1), (roof(0.4, DARK), np.eye(4))])
    assert irradiance(linked(covered, ONE_OUT))[0] == 0


@pytest.mark.parametrize("name", LAMPS)
@pytest.mark.parametrize("roughness", [1.0, 0.2])
def test_what_the_light_does_not_reach_is_black(name: str, roughness: float) -> None:
    """Neither light samples nor scattered rays bring any of it; what it reaches gets it whole."""
    metal = Surface("", diffuse_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=roughness)
    floor, table = ground(4), TWO

    def image(row: int, number: int) -> np.ndarray:
        shapes = [(replace(floor, surface=len(SURFACES), link_row=row), np.eye(4)), lamp(name, light_link=number)]
        camera = perspective(translation(0, 0.3, 2) @ rotation([1, 0, 0], -20), 0.3)
        d = linked(describe(shapes, (*SURFACES, metal), [], camera, (16, 16)), table)
        return replicate_means(render(d.build(), 64, max_depth=1)).mean(axis=0)[10:]  # the floor below the lamp

    assert image(2, 1).max() == 0
    np.testing.assert_array_equal(image(1, 1), image(0, 0))
    assert image(1, 1).max() > 0.005


def test_special_shadows_and_scattered_rays_do_not_add_up() -> None:
    metal = Surface("", diffuse_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.3)
    means = []
    for rules in ({}, {"shadow_link": 1}):
        shapes = [(replace(ground(4), surface=len(SURFACES)), np.eye(4)), lamp("quad", **rules)]
        camera = perspective(translation(0, 0.5, 2) @ rotation([1, 0, 0], -14), 0.3)
        d = linked(describe(shapes, (*SURFACES, metal), [], camera, (16, 16)), ONE_OUT)
        means.append(replicate_means(render(d.build(), 1024, max_depth=1)).mean())
    assert means[0] == pytest.approx(means[1], rel=0.01)


@pytest.mark.parametrize("row", [1, 2])
def test_a_mirror_shows_the_shapes_whose_light_reaches_it(row: int) -> None:
    wall = quad([[5, -5, 2], [-5, -5, 2], [-5, 5, 2], [5, 5, 2]])
    behind = wears(wall, 3.0, 1, own_color=True, shows_own=True, light_link=1)
    shapes: list[tuple[Shape, Doubles]] = [(facing(-2, 0, row), np.eye(4)), (behind, np.eye(4))]
    d = linked(describe(shapes, [MIRROR, SURFACES[LAMP_SURFACE]], [], perspective(np.eye(4), 0.2)), TWO)
    pixels = render(d.build(), 4).pixels()[..., 0]
    np.testing.assert_allclose(pixels, 3.0 if row == 1 else 0.0, rtol=1e-3)
