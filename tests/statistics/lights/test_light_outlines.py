"""Camera rays of their own for lights that end in a pixel: the picture is the one of paths alone, and far less noisy.

A lens of almost no radius turns them off (build/lights/light_outlines.cpp), and shows the same picture otherwise.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import (
    Described,
    describe,
    ground,
    lambert,
    light,
    look_at,
    perspective,
    quad,
    render,
    rotation,
    translation,
)
from tests.statistics.lights.placed_lights import SHEAR

from primray.description import Light, LightType
from primray.settings import Filter

Doubles = npt.NDArray[np.float64]
TURNED = rotation([1, 2, 0.5], 130)
SEEN = [
    light(LightType.SPHERE, translation(-0.55, 0.4, 0), (30.0, 20.0, 10.0), radius=0.02),
    light(LightType.SPHERE, translation(-0.3, 0.5, 0.2), 20.0, radius=0.15),
    light(LightType.SPHERE, translation(-0.1, 0.55, 0.4), 8.0, radius=0.12),  # before a part of the last one
    light(LightType.SPHERE, translation(0.62, 0.75, 0) @ SHEAR, 12.0, radius=0.07),
    light(LightType.SPHERE, translation(-0.6, 0.8, 0.1), 90.0, radius=0.003),
    light(LightType.DISK, translation(0.3, 0.7, 0) @ TURNED, 25.0, radius=0.12),
    light(LightType.RECT, translation(0.6, 0.35, 0) @ rotation([0, 1, 0.4], 150), 15.0, width=0.3, height=0.2),
    light(LightType.CYLINDER, translation(0, 0.85, 0) @ rotation([0, 0, 1], 25), 18.0, radius=0.03, length=0.4),
    light(LightType.SPHERE, translation(0.25, 0.3, -0.3), 40.0, radius=0.08),  # half behind the screen
    light(LightType.SPHERE, translation(-0.3, 0.2, -0.3), 40.0, radius=0.05, visible_to_camera=False),
]
SCREEN = quad([[0.25, 0, -0.1], [0.6, 0, -0.1], [0.6, 0.5, -0.1], [0.25, 0.5, -0.1]])


def scene_of(lights: list[Light], lens_radius: float = 0.0, albedo: float = 0.5) -> Described:
    camera = perspective(look_at([0, 0.6, 2.2], [0, 0.5, 0]), 0.25, 1.5, lens_radius=lens_radius, focus_distance=2.2)
    return describe([(ground(2), np.eye(4)), (SCREEN, np.eye(4))], [lambert(albedo)], lights, camera, (24, 16))


def pictures(made: Described, spp: int, seeds: int, filter: Filter = Filter.BOX) -> Doubles:
    """(seeds, H, W, 3)."""
    scene = made.build(filter=filter)
    return np.array([render(scene, spp, seed=s, max_depth=1, splits=1).pixels()[..., :3] for s in range(seeds)], np.float64)


def relative_variance(made: Doubles) -> Doubles:
    return np.asarray(np.var(made, axis=0, ddof=1) / (made.mean(axis=0) ** 2 + 0.01))


@pytest.mark.parametrize("filter", [Filter.BOX, Filter.GAUSSIAN])
def test_the_picture_is_that_of_paths_alone(filter: Filter) -> None:
    """By 384 pixels of three colours: beyond 5.5 standard errors of 48 pictures lies one in 10^5 such tests. Two samples that
    see the brightest light or do not show in no standard error."""
    seeds = 48
    own, alone = (pictures(scene_of(SEEN, lens), 128, seeds, filter) for lens in (0.0, 1e-9))
    error = np.sqrt((np.var(own, axis=0, ddof=1) + np.var(alone, axis=0, ddof=1)) / seeds)
    away = np.abs(own.mean(axis=0) - alone.mean(axis=0))
    assert (away <= 5.5 * error + 2 * 90 / (128 * seeds)).all()
    np.testing.assert_allclose(own.mean(), alone.mean(), rtol=2e-3)


def test_outlines_are_quiet() -> None:
    own, alone = (relative_variance(pictures(scene_of(SEEN, lens, 0.0), 16, 16)) for lens in (0.0, 1e-9))
    assert own.mean() < 0.1 * alone.mean()


def test_a_light_in_the_corner_of_a_pixel() -> None:
    """Of which it covers a thousandth: where the light is bright that is most of what the pixel shows."""
    tiny = [light(LightType.SPHERE, translation(-0.0312, 0.6, 0), 3e3, radius=0.0016)]
    own, alone = (relative_variance(pictures(scene_of(tiny, lens, 0.0), 16, 16)) for lens in (0.0, 1e-9))
    assert own.max() < 0.02 * alone.max()


def test_many_lights_that_are_weighed_by_a_tree() -> None:
    rng = np.random.default_rng(4)
    many = [
        light(LightType.SPHERE, translation(*rng.uniform([-0.7, 0.1, -0.5], [0.7, 0.9, 0.5])), 40, radius=0.01)
        for _ in range(40)
    ]
    own, alone = (pictures(scene_of(many, lens), 64, 24) for lens in (0.0, 1e-9))
    np.testing.assert_allclose(own.mean(), alone.mean(), rtol=4e-3)
    assert relative_variance(own).mean() < 0.1 * relative_variance(alone).mean()


def test_what_is_behind_the_camera_or_around_it_is_left_to_paths() -> None:
    around = [
        light(LightType.SPHERE, translation(0, 0.6, 2.2), 3.0, radius=0.5),  # seen from inside: not at all
        light(LightType.SPHERE, translation(0, 0.6, 4), 3.0, radius=0.5),
        light(LightType.CYLINDER, translation(0, 0.3, 0) @ rotation([0, 1, 0], 90), 5.0, radius=0.02, length=9.0),
    ]
    own, alone = (pictures(scene_of(around, lens), 128, 16) for lens in (0.0, 1e-9))
    np.testing.assert_allclose(own.mean(), alone.mean(), rtol=5e-3)


def test_lanes_and_blocks_show_in_no_bit() -> None:
    scene = scene_of(SEEN).build()
    one, most = (render(scene, 48, lanes=lanes, splits=1).pixels() for lanes in (1, 0))
    np.testing.assert_array_equal(one, most)
    begun = render(scene, 16, splits=1)
    np.testing.assert_array_equal(render(scene, 48, splits=1, film=begun.film).pixels(), most)


def test_a_crowd_of_lights_in_a_pixel_is_left_to_paths() -> None:
    """Each would have rays of its own there: a pixel of ten thousand lights would take forever."""

    def shadow_rays(count: int) -> int:
        lights = [light(LightType.SPHERE, translation(0.4 + 1e-4 * i, 0.6, 0), 5.0, radius=0.01) for i in range(count)]
        return int(render(scene_of(lights, albedo=0.0).build(), 64, max_depth=1, splits=1).shadow_rays)

    assert shadow_rays(4) > 100
    assert shadow_rays(100) == 0
