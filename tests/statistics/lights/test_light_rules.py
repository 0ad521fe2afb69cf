"""Whom lights reach, who casts their shadows and how, whether the camera sees them: against closed forms and quadrature."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import (
    Described,
    box,
    describe,
    ground,
    lambert,
    light,
    look_at,
    orthographic,
    perspective,
    quad,
    render,
    replicate_means,
    rotation,
    translation,
)
from tests.statistics.lights.placed_lights import irradiances
from tests.statistics.lights.test_irradiance import (
    ABOVE,
    ALBEDO,
    HALF,
    LIGHTS,
    RESOLUTION,
    SPP,
    compare,
    expected_irradiance,
    film_points,
)

from primray.description import Light, LightType, Linked, Shadow, Sphere, Surface
from primray.description.geometry import Shape

EVERYBODY = np.ones((1, 2), np.bool_)
# Row 0 is in collection 1, row 1 is not.
ONE_OUT = Linked(("/light.collection:shadowLink",), np.array([[1, 1], [1, 0]], np.bool_))
BLACK = lambert(0.0)
MIRROR = Surface("/mirror", diffuse_color=(1, 1, 1), metallic=1.0, roughness=0.0)
HALF_THERE = Surface("/half", opacity=0.5, presence=True)


def roof(height: float, surface: int = 1, half: float = 50.0, row: int = 0) -> Shape:
    s = half
    corners = [[-s, height, s], [s, height, s], [s, height, -s], [-s, height, -s]]
    return replace(quad(corners, surface), link_row=row)


def plane(
    lights: list[Light], shapes: Sequence[Shape] = (), linked: Linked | None = None, row: int = 0, **more: Any
) -> Described:
    """A ground seen from close above, below all else."""
    camera = orthographic(look_at([0, 0.01, 0], [0, 0, 0], up=(0, 0, -1)), HALF, clipping_range=(1e-4, 1.0))
    floor = replace(ground(5), link_row=row)
    surfaces = [lambert(ALBEDO), BLACK, HALF_THERE]
    d = describe(
        [(s, np.eye(4)) for s in (floor, *shapes)], surfaces, lights, camera, (RESOLUTION, RESOLUTION), **more
    )  # fmt: skip
    return replace(d, description=replace(d.description, linked=linked)) if linked else d


def irradiance(described: Described, spp: int = SPP, **more: Any) -> np.ndarray:
    """(H, W, 3)"""
    result = render(described.build(), spp, **more)
    assert result.invalid_samples == 0
    return replicate_means(result).mean(axis=0) / (np.array(ALBEDO) / math.pi)


def expected(x: Light) -> np.ndarray:
    if x.type is LightType.DOME:
        return np.full((RESOLUTION, RESOLUTION), math.pi)
    return expected_irradiance(x)


DOME = light(LightType.DOME)
KINDS = {name: LIGHTS[name] for name in ("point", "sphere", "ellipsoid", "disk", "rect", "cylinder", "sun", "delta sun")}
KINDS |= {"distant 120": LIGHTS["distant 120"], "dome": DOME}
FREE: dict[str, dict[str, Any]] = {
    "not cast by it": {"shadow_link": 1},
    "without shadows": {"shadow": Shadow(enabled=False)},
    "out of reach": {"shadow": Shadow(distance=0.02)},
}
TINT = (0.2, 0.5, 1.0)


@pytest.mark.conforms("LightAPI.collection:shadowLink:includeRoot", "ShadowAPI.inputs:shadow:enable")
@pytest.mark.conforms("ShadowAPI.inputs:shadow:distance")
@pytest.mark.parametrize("why", FREE)
@pytest.mark.parametrize("name", KINDS)
def test_under_a_roof_that_casts_no_shadow(name: str, why: str) -> None:
    x = replace(KINDS[name], **FREE[why])
    scene = plane([x], [roof(0.03, row=1)], ONE_OUT).build()
    compare(render(scene, 4 * SPP if name == "dome" else SPP), expected(x))


@pytest.mark.parametrize("name", KINDS)
def test_under_a_roof_that_casts_a_shadow(name: str) -> None:
    x = replace(KINDS[name], shadow_link=1)
    assert irradiance(plane([x], [roof(0.03)], ONE_OUT), 16).max() == 0


@pytest.mark.conforms("ShadowAPI.inputs:shadow:color")
@pytest.mark.parametrize("name", KINDS)
def test_shadow_color(name: str) -> None:
    """L (c + (1 - c) visible): with the same samples, an image between the one without shadows and the one with black ones."""
    x = KINDS[name]
    part = box([0.8, 0.3, 0.8], 1)
    shapes: list[Shape] = [replace(part, points=part.points + np.array([0.2, 0.4, 0.1], np.float32))]

    def image(**shadow: Any) -> np.ndarray:
        return irradiance(plane([replace(x, shadow=Shadow(**shadow))], shapes), 64, splits=1)  # the pilot's choice differs

    bright, dark = image(enabled=False), image(distance=1e6)
    assert dark.min() < 0.5 * bright.max()
    assert (dark <= bright * (1 + 1e-5)).all()
    c = np.array(TINT)
    np.testing.assert_allclose(image(color=TINT), c * bright + (1 - c) * dark, rtol=2e-5, atol=1e-6)
    whole = irradiance(plane([replace(x, shadow=Shadow(color=TINT))], [roof(0.03)]), 64, splits=1)
    np.testing.assert_allclose(whole, c * bright, rtol=2e-5)


def distances(height: float, source: np.ndarray) -> np.ndarray:
    """From the middle of each pixel to a roof, towards a point."""
    c = ((np.arange(RESOLUTION) + 0.5) / RESOLUTION * 2 - 1) * HALF
    z, x = np.meshgrid(c, c, indexing="ij")
    p = np.stack([x, np.zeros_like(x), z], axis=-1)
    to = source - p
    return height * np.linalg.norm(to, axis=-1) / to[..., 1]


SOURCE = np.array([0.1, 1.5, -0.2])


@pytest.mark.conforms("ShadowAPI.inputs:shadow:falloff", "ShadowAPI.inputs:shadow:falloffGamma")
@pytest.mark.parametrize(("falloff", "gamma"), [(0.2, 1.0), (0.2, 2.5), (0.25, 0.4), (5.0, 1.0), (0.2, 0.0)])
@pytest.mark.parametrize("tint", [(0.0, 0.0, 0.0), TINT])
def test_falloff_of_a_point_light(falloff: float, gamma: float, tint: tuple[float, float, float]) -> None:
    """Visible: 1 - ((distance - t) / falloff)^gamma between distance - falloff and distance."""
    height, end = 0.5, 0.65
    shadow = Shadow(color=tint, distance=end, falloff=falloff, falloff_gamma=gamma)
    x = light(LightType.POINT, translation(*SOURCE), 3.0)
    # One sample in the middle of each pixel: an almost empty filter.
    shaded = render(plane([replace(x, shadow=shadow)], [roof(height)]).build(filter_width=1e-6), 2)
    plain = render(plane([x]).build(filter_width=1e-6), 2)
    t, zone = distances(height, SOURCE), min(falloff, end)
    strength = np.where(t < end, np.clip((end - t) / zone, 0, 1) ** gamma, 0.0)
    assert (strength == 0).any()
    assert (strength > 0.05).any()
    c = np.array(tint)
    factor = c + (1 - c) * (1 - strength[..., None])
    np.testing.assert_allclose(shaded.pixels()[..., :3], plain.pixels()[..., :3] * factor, rtol=3e-5, atol=2e-5)


def test_a_hard_end_of_shadows_is_where_the_distance_says() -> None:
    height, end = 0.5, 0.65
    x = light(LightType.POINT, translation(*SOURCE), 3.0, shadow=Shadow(distance=end))
    lit = render(plane([x], [roof(height)]).build(filter_width=1e-6), 2).pixels()[..., 0] > 0
    assert (lit == (distances(height, SOURCE) >= end)).all()
    assert lit.any()
    assert not lit.all()


def test_the_first_opaque_caster_decides() -> None:
    """A thin body's back does not deepen what its front leaves; what casts nothing does not count."""
    x = light(LightType.DISTANT, ABOVE, shadow=Shadow(distance=1.0, falloff=1.0), shadow_link=1)
    shapes = [roof(0.1, row=1), roof(0.4), roof(0.5), roof(0.6)]
    t = 0.4 / (ABOVE[:3, :3] @ [0, 0, 1])[1]
    plain = irradiance(plane([replace(x, shadow=None, shadow_link=0)]), 2)
    np.testing.assert_allclose(irradiance(plane([x], shapes, ONE_OUT), 2), plain * t, rtol=1e-5)


@pytest.mark.parametrize("pane_row", [0, 1])
@pytest.mark.parametrize("shadow", [None, Shadow(color=TINT), Shadow(distance=1.0, falloff=1.0)])
def test_through_panes(pane_row: int, shadow: Shadow | None) -> None:
    """Panes weaken the light as casters, each by its distance, and not at all where they cast no shadow of it."""
    x = light(LightType.DISTANT, rotation([1, 0, 0], -90), shadow=shadow, shadow_link=1)
    found = irradiance(plane([x], [roof(0.1, 2, row=pane_row), roof(0.4, 2, row=pane_row)], ONE_OUT), 2, max_depth=1)
    through = 0.25 if pane_row == 0 else 1.0
    if shadow is not None and shadow.distance > 0 and pane_row == 0:
        through = (1 - 0.9 * 0.5) * (1 - 0.6 * 0.5)
    c = np.zeros(3) if shadow is None else np.array(shadow.color)
    np.testing.assert_allclose(found, np.broadcast_to(c + (1 - c) * through, found.shape), rtol=1e-5)


TWO = Linked(("/a", "/b"), np.array([[1, 1, 1], [1, 1, 0], [1, 0, 1], [1, 0, 0]], np.bool_))


@pytest.mark.conforms("LightAPI.collection:lightLink:includeRoot")
def test_two_spheres_lit_by_a_light_each() -> None:
    left = light(LightType.RECT, translation(0, 3, 1) @ rotation([1, 0, 0], -70), (4.0, 0.0, 0.0), light_link=1)
    right = light(LightType.SPHERE, translation(0, 3, 2), (0.0, 4.0, 0.0), light_link=2)
    spheres = [
        (Sphere("/a", 0.5, 0, link_row=1), translation(-1, 0, 0)),
        (Sphere("/b", 0.5, 0, link_row=2), translation(1, 0, 0)),
    ]
    camera = perspective(look_at([0, 0, 4], [0, 0, 0]), 0.5, 2.0)
    d = describe(spheres, [lambert(0.8)], [left, right], camera, (64, 32))
    d = replace(d, description=replace(d.description, linked=TWO))
    pixels = render(d.build(), 16, max_depth=1).pixels()
    a, b = pixels[:, :32], pixels[:, 32:]
    assert (a[..., 1] == 0).all()
    assert (b[..., 0] == 0).all()
    assert ((a[..., 0] > 0) <= (a[..., 3] > 0)).all()
    assert a[..., 0].max() > 0.1
    assert b[..., 1].max() > 0.05


@pytest.mark.parametrize("row", [0, 1, 2, 3])
@pytest.mark.parametrize("others", [0, 40])
def test_irradiance_of_linked_lights(row: int, others: int) -> None:
    """Few lights are weighed, many chosen by a tree; a surface gets exactly those that reach it."""
    lights = [
        replace(LIGHTS["rect"], light_link=1),
        replace(LIGHTS["cylinder"], light_link=2),
        replace(LIGHTS["distant 120"], light_link=2),
        light(LightType.DOME, emission=0.2, light_link=1),
        *[light(LightType.SPHERE, translation(0.05 * k - 1, 1.5, 0), 50.0, radius=0.1, light_link=1) for k in range(others)],
    ]
    d = plane(lights, linked=TWO, row=row)
    reached = [x for x in lights if TWO.members[row, x.light_link]]
    if not reached:
        assert irradiance(d, 16).max() == 0
        return
    p, weights = film_points()
    total = np.zeros((RESOLUTION, RESOLUTION))
    for x in reached:
        if x.type is LightType.DOME:
            total += 0.2 * math.pi
        else:
            e = irradiances(x, p.reshape(-1, 3), [0, 1, 0], 48)
            total += x.emission[0] * (e.reshape(RESOLUTION, RESOLUTION, 9) @ weights)
    compare(render(d.build(), 4 * SPP), total)


def test_textured_dome_with_special_shadows() -> None:
    """All of its light is found by sampling it, not only what exceeds the mean."""
    texture = np.random.default_rng(8).random((8, 16, 1)).astype(np.float32) ** 6 * np.ones(3, np.float32)
    x = light(LightType.DOME, rotation([1, 2, -1], 70))
    free = irradiance(plane([x], dome_texture=texture), 2048)
    special = plane([replace(x, shadow_link=1)], [roof(0.03, row=1)], ONE_OUT, dome_texture=texture)
    np.testing.assert_allclose(irradiance(special, 2048).mean(), free.mean(), rtol=4e-3)


def seen(d: Described, linked: Linked | None = None, spp: int = 4) -> np.ndarray:
    return render(replace(d, description=replace(d.description, linked=linked or d.description.linked)).build(), spp).pixels()


def lamp(**more: Any) -> Light:
    return light(LightType.RECT, translation(0, 0, -2) @ rotation([0, 1, 0], 180), 3.0, width=2.0, height=2.0, **more)


FORWARD = perspective(np.eye(4), 0.2)


def facing(z: float, surface: int, row: int = 0) -> Shape:
    """A wall across the view, facing the camera."""
    return replace(quad([[-5, -5, z], [5, -5, z], [5, 5, z], [-5, 5, z]], surface), link_row=row)


@pytest.mark.parametrize("visible", [True, False])
@pytest.mark.parametrize("pane", [False, True])
def test_camera_sees_a_light_or_what_is_behind(visible: bool, pane: bool) -> None:
    x = lamp(visible_to_camera=visible)
    shapes = [(facing(-1, 0), np.eye(4))] if pane else []
    pixels = seen(describe(shapes, [HALF_THERE], [x], FORWARD))
    if not pane:
        assert np.all(pixels == ([3, 3, 3, 1] if visible else [0, 0, 0, 0]))
    else:
        assert pixels[..., 0].max() == (1.5 if visible else 0)
    wall = seen(describe([*shapes, (facing(-3, 1), np.eye(4))], [HALF_THERE, lambert(0.0, emission=0.25)], [x], FORWARD))
    assert wall[..., 0].min() == (0.5 if pane else 1.0) * (3.0 if visible else 0.25)
    assert wall[..., 3].min() == 1


@pytest.mark.parametrize("texture", [None, np.ones((2, 4, 3), np.float32)])
def test_a_dome_that_the_camera_does_not_see_lights_all_the_same(texture: Any) -> None:
    hidden = light(LightType.DOME, emission=0.5, visible_to_camera=False)
    empty = seen(describe([], [], [hidden], FORWARD, dome_texture=texture))
    assert (empty == 0).all()
    np.testing.assert_allclose(irradiance(plane([hidden], dome_texture=texture), 256).mean(), 0.5 * math.pi, rtol=3e-3)


def mirrored(x: Light, row: int) -> Described:
    """A mirror across the view and a light behind the camera."""
    return describe([(facing(-2, 0, row), np.eye(4))], [MIRROR], [x], FORWARD)


@pytest.mark.parametrize("hidden", [True, False])
def test_a_mirror_shows_the_lights_that_reach_it(hidden: bool) -> None:
    behind = translation(0, 0, 2)
    for kind in (LightType.RECT, LightType.SPHERE):
        x = light(kind, behind, 3.0, width=9.0, height=9.0, light_link=1, visible_to_camera=not hidden)
        x = replace(x, radius=1.9) if kind is LightType.SPHERE else x
        shown = [seen(mirrored(x, row), TWO)[3:5, 3:5, 0] for row in (1, 2)]
        np.testing.assert_allclose(shown[0], 3.0, rtol=1e-3)
        assert (shown[1] == 0).all()
    dome = light(LightType.DOME, emission=2.0, light_link=1, visible_to_camera=not hidden)
    np.testing.assert_allclose(seen(mirrored(dome, 1), TWO)[..., 0], 2.0, rtol=1e-3)
    assert (seen(mirrored(dome, 2), TWO)[..., 0] == 0).all()


def test_a_mirror_shows_a_light_with_special_shadows_behind_what_hides_it() -> None:
    x = replace(light(LightType.RECT, translation(0, 0, 2), 3.0, width=9.0, height=9.0), shadow=Shadow(enabled=False))
    assert seen(mirrored(x, 0))[..., 0].min() > 2.99
    hidden = mirrored(x, 0).description
    screen = quad([[5, -5, 1], [-5, -5, 1], [-5, 5, 1], [5, 5, 1]], 1)
    d = describe([(hidden.shapes[0], np.eye(4)), (screen, np.eye(4))], [MIRROR, BLACK], [x], FORWARD)
    assert (seen(d)[..., 0] == 0).all()
