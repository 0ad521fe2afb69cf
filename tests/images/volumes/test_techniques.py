"""Lights are sampled along rays through smoke where few of them are, and at vertices alone where any is linked: both have the
same mean, for lights of all types. And what light linking and special shadows mean in smoke."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

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
    quad,
    rotation,
    scaling,
    translation,
)
from tests.images.volumes.voxels import Array, along, block, check, glow, medium, picture, voxels

from primray.description import Doubles, Light, LightType, Linked, OpenPbr, Shadow, Shape, Shaping, Sphere, Surface

SIZE = (24, 24)
DOWN = rotation((1, 0, 0), -90)
ALL = Linked(("/light.collection:lightLink",), np.ones((1, 2), np.bool_))
CLOUD = voxels(np.random.default_rng(7).random((16, 16, 16)) ** 2, (-8, -8, -8))

LIGHTS: dict[str, Sequence[Light]] = {
    "point": [light(LightType.POINT, translation(1, 3, -1), 20.0)],
    "point aside": [light(LightType.POINT, translation(15, 12, 3), 500.0)],
    "sphere": [light(LightType.SPHERE, translation(2, 1, 4), 5.0, radius=1.5)],
    "rect": [light(LightType.RECT, translation(0, 6, 0) @ DOWN, 10.0, width=2.0, height=1.0)],
    "disk": [light(LightType.DISK, translation(-3, 0, 2) @ rotation((0, 1, 0), 50), 10.0, radius=1.0)],
    "cylinder": [light(LightType.CYLINDER, translation(0, -3, 1) @ rotation((0, 0, 1), 30), 10.0, radius=0.2, length=4.0)],
    "line": [light(LightType.LINE, translation(0, 9, 1), 30.0, length=3.0)],
    "soft spot": [
        light(
            LightType.SPHERE,
            translation(0, 12, 0) @ DOWN,
            500.0,
            radius=0.3,
            shaping=Shaping(cone_angle_deg=25.0, cone_softness=0.5, focus=3.0),
        )
    ],
    "spot inside": [light(LightType.POINT, translation(0, 1, 0) @ DOWN, 30.0, shaping=Shaping(cone_angle_deg=40.0))],
    "rect spot": [
        light(LightType.RECT, translation(0, 10, 0) @ DOWN, 80.0, width=3.0, height=0.5, shaping=Shaping(cone_angle_deg=30.0))
    ],
    "several": [
        light(LightType.POINT, translation(1, 3, -1), 20.0),
        light(LightType.SPHERE, translation(-4, 1, 4), 5.0, radius=1.0),
        light(LightType.DISTANT, rotation((1, 0.3, 0), -50), 1.0),
        light(LightType.DOME, emission=0.2),
        light(LightType.POINT, translation(0, 12, 0) @ DOWN, 300.0, shaping=Shaping(cone_angle_deg=20.0)),
    ],
    "forty": [light(LightType.POINT, translation(7 * math.cos(k), 5 * math.sin(k), 0.2 * k - 4), 3.0) for k in range(40)],
    "without shadows": [light(LightType.SPHERE, translation(2, 1, 4), 5.0, radius=1.5, shadow=Shadow(enabled=False))],
    "hidden": [light(LightType.SPHERE, translation(2, 1, 4), 5.0, radius=1.5, visible_to_camera=False)],
}


def pairs(scene: Described) -> tuple[Described, Described]:
    """Return a scene, and one with a link that includes everything, in which lights are sampled at vertices alone."""
    linked = [replace(x, light_link=1) for x in scene.description.lights]
    return scene, replace(scene, description=replace(scene.description, lights=tuple(linked), linked=ALL))


def assert_equal_means(scene: Described, spp: int = 256, **values: Any) -> None:
    """Check that the difference is within 4 standard errors, most of which are those of vertices near to a light."""
    one, other = (picture(s, spp, **values).reshape(-1, 3) for s in pairs(scene))
    difference = one - other
    error, scale = difference.std(axis=0) / math.sqrt(len(difference)), one.mean(axis=0)
    assert (error < 0.1 * scale).all(), error / scale
    assert (np.abs(difference.mean(axis=0)) < 4 * error + 1e-6 * scale).all(), (difference.mean(axis=0) / scale, error / scale)


CAMERA = perspective(look_at((3, 2, 40), (0, 0, 0)), 0.25)


@pytest.mark.parametrize("name", LIGHTS)
def test_both_techniques_have_one_mean(name: str) -> None:
    smoke = medium(CLOUD, (0.3, 0.2, 0.1), (0.9, 0.8, 0.7), anisotropy=0.4)
    scene = describe(media=[smoke], lights=LIGHTS[name], camera=CAMERA, resolution=SIZE)
    assert_equal_means(scene, max_depth=3)


@pytest.mark.parametrize("anisotropy", [0.6, 0.85, -0.9])
@pytest.mark.parametrize("name", ["point", "point aside", "rect", "soft spot", "several", "forty"])
def test_peaked_phase_functions(name: str, anisotropy: float) -> None:
    """Distances and lights are chosen by the phase function, which is the mean of those of two kinds of smoke."""
    smoke = [
        medium(CLOUD, (0.3, 0.2, 0.1), (0.9, 0.8, 0.7), anisotropy=anisotropy),
        medium(block(), 0.02, 1.0, anisotropy=0.55),
    ]
    # Vertices as near to a point as they come would have the error of a few.
    lights = [replace(x, type=LightType.SPHERE, radius=0.7) if x.type == LightType.POINT else x for x in LIGHTS[name]]
    scene = describe(media=smoke, lights=lights, camera=CAMERA, resolution=SIZE)
    assert_equal_means(scene, 1024, max_depth=3)


@pytest.mark.parametrize("extinction", [0.01, 1.0])
def test_thin_and_dense_smoke(extinction: float) -> None:
    scene = describe(
        media=[medium(CLOUD, extinction, 0.9), medium(block(), 0.1, 1.0, anisotropy=-0.6)],
        lights=[LIGHTS["point"][0], LIGHTS["soft spot"][0]],
        camera=CAMERA,
        resolution=SIZE,
    )
    assert_equal_means(scene, max_depth=2)


GLASS = {
    "none": None,
    "thin": Surface("", opacity=0.0, roughness=0.0, thin=True),
    "absorbing": Surface(
        "",
        open_pbr=OpenPbr(
            transmission_weight=1.0,
            specular_roughness=0.3,
            specular_ior=1.2,
            transmission_depth=6.0,
            transmission_color=(0.9, 0.5, 0.3),
        ),
    ),
}


@pytest.mark.parametrize("name", GLASS)
def test_beside_surfaces(name: str) -> None:
    """A floor and a wall below smoke, and a body of glass around some of it."""
    surfaces = [lambert((0.7, 0.5, 0.3)), GLASS[name] or lambert(0.5)]
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(30), translation(0, -9, 0)),
        (Sphere("/ball", 2.0, 0), translation(3, -6, 4)),
    ]
    if GLASS[name]:
        shapes.append((Sphere("/glass", 3.0, 1), translation(-4, -3, 5)))
    scene = describe(
        shapes, surfaces, [LIGHTS["point"][0], LIGHTS["rect"][0]], CAMERA, SIZE, media=[medium(CLOUD, 0.2, 0.9, anisotropy=0.3)]
    )  # fmt: skip
    assert_equal_means(scene, 64, max_depth=4)


def test_many_instances_of_clouds() -> None:
    """The hierarchy finds what few instances, tested one by one, do; lights are not sampled along rays there."""
    rng = np.random.default_rng(1)
    places = [translation(*rng.uniform(-6, 6, 3)) @ scaling(0.4, 0.4, 0.4) for _ in range(8)]
    lamp = LIGHTS["sphere"]
    few, many = (
        describe(media=[medium(CLOUD, 0.6, 0.8, matrices=m)], lights=lamp, camera=CAMERA, resolution=SIZE)
        for m in (places, [*places, translation(0, 0, -1e4) @ scaling(1e-3, 1e-3, 1e-3)])
    )
    one, other = (picture(s, 256, max_depth=2).reshape(-1, 3) for s in (few, many))
    error = (one - other).std(axis=0) / math.sqrt(len(one))
    assert (np.abs((one - other).mean(axis=0)) < 4.5 * error).all()
    assert (error < 0.05 * one.mean()).all()


def test_surfaces_that_a_light_leaves_out_still_see_smoke_that_it_lights() -> None:
    """Row 1 is not in the light's collection: it has no light of its own, but reflects that of the smoke before it."""
    linked = Linked(("/light.collection:lightLink",), np.array([[1, 1], [1, 0]], np.bool_))
    sun = light(LightType.DISTANT, DOWN, math.pi)
    camera = along((0, -1, 0), (0, -10, 0), half=1e-3, distance=1.0)
    smoke = medium(voxels(np.ones((16, 8, 16)), (-8, -8, -8)), 0.1, 1.0)

    def scene(lamp: Light, row: int) -> Array:
        floor = replace(ground(100), link_row=row)
        d = describe(
            [(floor, translation(0, -10, 0))], [lambert(1.0)], [lamp], camera, SIZE, media=[smoke]
        )  # fmt: skip
        return picture(replace(d, description=replace(d.description, linked=linked)), 512, max_depth=2).mean(axis=(0, 1))

    whole, direct = scene(sun, 0)[0], math.exp(-0.8)
    left_out = scene(replace(sun, light_link=1), 1)[0]
    assert left_out > 0.01
    assert left_out == pytest.approx(whole - direct, rel=0.1)


def test_smoke_attenuates_light_without_shadows() -> None:
    """shadow:enable 0 is about surfaces; smoke is not passed without loss."""
    roof = quad([[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], 1)
    smoke = [medium(block(), 0.05)]
    camera = along((0, -1, 0), (3.5, -20, 3.5), half=1e-2, distance=1.0)
    for kind, values in ((LightType.DISTANT, {}), (LightType.RECT, {"width": 1e-3, "height": 1e-3})):
        results = []
        for shadow, shapes in ((None, []), (Shadow(enabled=False), [(roof, translation(3.5, 20, 3.5))])):
            lamp = light(kind, translation(3.5, 30, 3.5) @ DOWN, 1e6 if values else math.pi, shadow=shadow, **values)
            floor = (ground(50), translation(0, -20, 0))
            scene = describe(
                [floor, *shapes], [lambert(1.0), lambert(0.0)], [lamp], camera, SIZE, media=smoke
            )  # fmt: skip
            results.append(picture(scene, 2048, max_depth=1))
        if not values:
            check(results[0], math.exp(-0.4))
        check(results[1], results[0].mean(axis=(0, 1)), 0.004)


def test_colored_shadows_are_of_surfaces() -> None:
    """A shadow's color is seen behind a surface; smoke dims that as well."""
    roof = (quad([[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], 1), translation(3.5, 20, 3.5))
    camera = along((0, -1, 0), (3.5, -20, 3.5), half=1e-2, distance=1.0)
    sun = light(LightType.DISTANT, DOWN, math.pi, shadow=Shadow(color=(0.2, 0.5, 1.0)))
    floor = (ground(50), translation(0, -20, 0))
    scene = describe(
        [floor, roof], [lambert(1.0), lambert(0.0)], [sun], camera, SIZE, media=[medium(block(), 0.05)]
    )  # fmt: skip
    check(picture(scene, 4096, max_depth=1), math.exp(-0.4) * np.array((0.2, 0.5, 1.0)))


def test_fires_and_links() -> None:
    """A light that is linked leaves the fire's own light as it is."""
    floor = (ground(100), translation(0, -20, 0))
    camera = along((0, -1, 0), (3.5, -20, 3.5), half=1e-3, distance=1.0)
    lamp = light(LightType.SPHERE, translation(10, 0, 3.5), 5.0, radius=1.0)
    scene = describe([floor], [lambert(1.0)], [lamp], camera, SIZE, volume_emissions=[glow(block(), 1.0)])
    assert_equal_means(scene, max_depth=1)
