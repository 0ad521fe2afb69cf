"""Shapes that are lights (UsdLux LightAPI, light:materialSyncMode): what they light with, and what the camera sees of them."""

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
    placement,
    quad,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.statistics.lights.placed_lights import irradiances

from primray.description import Doubles, Light, LightType, Mesh, Placed, Prototype, Shape, Sphere, Surface
from primray.usd.lights.geometry_light import EMISSION_ONLY

GLOWING = lambert(0.0, emission=5.0)
SURFACES = (lambert(1.0), GLOWING, lambert(0.0), EMISSION_ONLY)
PLAIN, DARK, LAMP_SURFACE = 1, 2, 3
DOWN = orthographic(look_at([0, 0.3, 0], [0, 0, 0], up=(0, 0, -1)), 0.1)
MODES = pytest.mark.conforms("LightAPI.light:materialSyncMode", "MeshLightAPI.light:materialSyncMode")


def wears(shape: Any, emission: float | tuple[float, float, float] = 1.0, surface: int = PLAIN, **more: Any) -> Any:
    return replace(shape, surface=surface, light=light(LightType.GEOMETRY, None, emission, **more))


def lamp_quad(width: float = 0.7, height: float = 0.3) -> Mesh:
    w, h = width / 2, height / 2
    return quad([[-w, 1, h], [w, 1, h], [w, 1, -h], [-w, 1, -h]], PLAIN)


def below(shapes: Sequence[tuple[Shape, Doubles]], lights: Sequence[Light] = (), **more: object) -> Described:
    return describe([(ground(4), np.eye(4)), *shapes], SURFACES, lights, DOWN, (16, 16), **more)  # type: ignore[arg-type]


def irradiance(d: Described, spp: int = 64) -> tuple[float, float]:
    result = render(d.build(), spp, max_depth=1)
    assert result.invalid_samples == 0
    pixels = replicate_means(result)[..., 1] * math.pi
    return float(pixels.mean()), float(np.abs(pixels[0] - pixels[1]).std() / 2 / math.sqrt(pixels[0].size))


def assert_same(a: tuple[float, float], b: tuple[float, float]) -> None:
    assert abs(a[0] - b[0]) <= 5 * math.hypot(a[1], b[1]) + 1e-4 * b[0], (a, b)


def as_rect(emission: float, width: float = 0.7, height: float = 0.3) -> Light:
    at = translation(0, 1, 0) @ rotation([1, 0, 0], -90)
    return light(LightType.RECT, at, emission, width=width, height=height)


# What is lit with where the glow is 5 and the light's own radiance 0.4: by light:materialSyncMode.
GIVEN: dict[str, tuple[Mesh, float, float]] = {
    "materialGlowTintsLight": (wears(lamp_quad(), 0.4), 5 * 0.4, 5.0),
    "independent": (wears(lamp_quad(), 0.4, own_color=True), 0.4, 5.0),
    "independent, no glow": (wears(lamp_quad(), 0.4, DARK, own_color=True), 0.4, 0.0),
    "noMaterialResponse": (wears(lamp_quad(), 0.4, LAMP_SURFACE, own_color=True, shows_own=True), 0.4, 0.4),
    "materialGlowTintsLight, no glow": (wears(lamp_quad(), 0.4, DARK), 0.0, 0.0),
    "materialGlowTintsLight, intensity 0": (wears(lamp_quad(), 0.0), 0.0, 5.0),
}


@MODES
@pytest.mark.parametrize("name", GIVEN)
def test_modes(name: str) -> None:
    mesh, given, shown = GIVEN[name]
    lit = irradiance(below([(mesh, np.eye(4))]))
    assert_same(lit, irradiance(below([], [as_rect(given)])))
    assert lit[1] <= 0.01 * lit[0]  # sampled, not met by chance
    # The camera from below; and in a mirror that looks up.
    eye = orthographic(look_at([0, 0.5, 0], [0, 1, 0], up=(0, 0, -1)), 0.05)
    seen = describe([(mesh, np.eye(4))], SURFACES, camera=eye)
    np.testing.assert_allclose(replicate_means(render(seen.build(), 4)), shown, rtol=1e-5)
    mirror = Surface("", diffuse_color=(1, 1, 1), metallic=1.0, roughness=0.0)
    down = describe([(mesh, np.eye(4)), (ground(1, 4), np.eye(4))], (*SURFACES, mirror), camera=DOWN)
    np.testing.assert_allclose(replicate_means(render(down.build(), 4, max_depth=1)), shown, rtol=1e-5)


@MODES
@pytest.mark.parametrize("name", ["materialGlowTintsLight", "independent", "noMaterialResponse"])
def test_scattered_rays_find_what_is_sampled(name: str) -> None:
    """On a glossy surface both ways find the light: weights that do not add up, or the glow itself, would show."""
    metal = Surface("", diffuse_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.25)
    mesh, given, _ = GIVEN[name]
    camera = perspective(look_at([0, 0.5, 2], [0, 0.1, 0]), 0.3)
    images = []
    for use_light in (False, True):
        shapes: list[tuple[Shape, Doubles]] = [(ground(1, 4), np.eye(4))]
        shapes += [] if use_light else [(mesh, np.eye(4))]
        d = describe(shapes, (*SURFACES, metal), [as_rect(given)] if use_light else [], camera, (24, 24))
        images.append(replicate_means(render(d.build(), 512, max_depth=1)))
    a, b = images
    noise = math.sqrt(sum(np.square(i[0] - i[1]).mean() / 4 for i in images) / (24 * 24))
    assert abs(a.mean() - b.mean()) < 5 * noise + 1e-4 * b.mean()


@MODES
def test_a_closed_room_of_light() -> None:
    """Le = 0.5 as a light's own, albedo 0.5: L = 1 inside, of which the camera sees the glow, 0.2, in place of Le."""
    glow = lambert(0.5, emission=0.2)
    room = replace(box([2, 3, 4]), light=light(LightType.GEOMETRY, None, 0.5, own_color=True))
    d = describe([(room, np.eye(4))], [glow], camera=perspective(np.eye(4), 1.0), resolution=(16, 16))
    mean = replicate_means(render(d.build(), 256)).mean(axis=0)[..., 0]
    assert abs(mean.mean() - 0.7) < 5 * mean.std() / 16


SHAPES: dict[str, Any] = {"mesh": box([0.2, 0.3, 0.1]), "sphere": Sphere("/s", 0.15, PLAIN)}
PLACES = [
    np.eye(4),
    scaling(2, 2, 2),
    scaling(1, 0.3, 2.5),
    rotation([1, 2, 0], 40) @ scaling(0.2, 1, 1) @ rotation([0, 1, 1], 30),
]


def world_area(shape: Any, m: Doubles) -> float:
    if isinstance(shape, Sphere):
        v, u = np.meshgrid((np.arange(1000) + 0.5) / 1000 * np.pi, (np.arange(1000) + 0.5) / 1000 * 2 * np.pi)
        n = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], axis=-1)
        cofactors = np.linalg.inv(m[:3, :3]).T * abs(np.linalg.det(m[:3, :3]))
        return float((np.linalg.norm(n @ cofactors.T, axis=-1) * np.sin(v)).mean() * 2 * np.pi**2 * shape.radius**2)
    p = (shape.points @ m[:3, :3].T)[shape.triangles]
    return float(np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2)


@pytest.mark.conforms("LightAPI.inputs:normalize")
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("k", range(len(PLACES)))
@pytest.mark.parametrize("own", [False, True])
def test_normalize_divides_by_the_area_in_the_world(name: str, k: int, own: bool) -> None:
    """As bright as the same shape without normalize and its radiance divided by its area."""
    shape, m = SHAPES[name], translation(0.1, 1, 0) @ PLACES[k]
    normalized = wears(shape, 2.0, normalize=True, own_color=own)
    plain = wears(shape, 2.0 / world_area(shape, m), own_color=own)
    assert_same(irradiance(below([(normalized, m)])), irradiance(below([(plain, m)])))


@pytest.mark.conforms("LightAPI.inputs:normalize")
@pytest.mark.parametrize("name", SHAPES)
def test_instances_have_areas_of_their_own(name: str) -> None:
    """Far apart, so that each lights its own ground; the camera sees each one's radiance too."""
    shape = wears(SHAPES[name], 2.0, LAMP_SURFACE, normalize=True, own_color=True, shows_own=True)
    for k, m in enumerate(PLACES):
        rows = [translation(1000.0 * (i - k), 1, 0) @ p for i, p in enumerate(PLACES)]
        d = below([], prototypes=[Prototype("/p", (Placed(1, np.eye(4)),))], prototype_shapes=[shape],
                  placements=[placement(0, rows)])  # fmt: skip
        alone = wears(SHAPES[name], 2.0 / world_area(SHAPES[name], m), LAMP_SURFACE, own_color=True, shows_own=True)
        assert_same(irradiance(d), irradiance(below([(alone, translation(0, 1, 0) @ m)])))
        eye = orthographic(look_at([0, 0.5, 0], [0, 1, 0], up=(0, 0, -1)), 0.001)
        seen = render(replace(d, description=replace(d.description, camera=eye)).build(), 4).pixels()[..., 0]
        np.testing.assert_allclose(seen, 2.0 / world_area(SHAPES[name], m), rtol=1e-4)


@pytest.mark.conforms("LightAPI.inputs:diffuse", "LightAPI.inputs:specular")
def test_lobe_multipliers() -> None:
    mesh = wears(lamp_quad(), 1.0, diffuse=0.25, specular=3.0)
    assert_same(irradiance(below([(mesh, np.eye(4))])), irradiance(below([], [as_rect(5 * 0.25)])))
    metal = Surface("", diffuse_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.3)
    images = []
    for factor in (3.0, 1.0):
        mesh = wears(lamp_quad(), 1.0, specular=factor)
        d = describe([(ground(4, 4), np.eye(4)), (mesh, np.eye(4))], (*SURFACES, metal), camera=DOWN, resolution=(16, 16))
        images.append(replicate_means(render(d.build(), 256, max_depth=1)).mean())
    assert images[0] / images[1] == pytest.approx(3.0, rel=0.02)


def test_a_textured_glow_tints() -> None:
    """materialGlowTintsLight where the glow varies: twice the light is twice the picture, and the camera's view is the same."""
    colors = np.random.default_rng(3).random((4, 1)).astype(np.float32) * np.ones((1, 3), np.float32)
    from primray.description import Interpolation, Primvar, PrimvarInput

    glow = Surface("", lambert=True, diffuse_color=(0, 0, 0), inputs=(("emissive_color", PrimvarInput("glow", (0.0,))),))
    surfaces = (*SURFACES, glow)
    mesh = replace(lamp_quad(), surface=4, primvars=(Primvar("glow", Interpolation.POINT, colors),))
    means = []
    for factor in (None, 1.0, 2.0):
        worn = mesh if factor is None else replace(mesh, light=light(LightType.GEOMETRY, None, factor))
        d = describe([(ground(4), np.eye(4)), (worn, np.eye(4))], surfaces, camera=DOWN, resolution=(16, 16))
        means.append(irradiance(d, 256))
    assert_same(means[0], means[1])
    assert_same(means[2], (2 * means[0][0], 2 * means[0][1]))


@pytest.mark.parametrize("own", [False, True])
def test_lights_among_emitters_of_no_light_and_holes(own: bool) -> None:
    """Parts of a light that are not there give nothing, and what glows beside it keeps its glow."""
    ghost = Surface("", diffuse_color=(0, 0, 0), emissive_color=(4, 4, 4), opacity=0.5, presence=True,
                    use_specular_workflow=True)  # fmt: skip
    light_of = light(LightType.GEOMETRY, None, 0.5, own_color=own)
    mesh = replace(lamp_quad(), surface=4, light=light_of)
    other = box([0.1, 0.1, 0.1], PLAIN)
    d = describe([(ground(4), np.eye(4)), (mesh, np.eye(4)), (other, translation(0.6, 1, 0))], (*SURFACES, ghost),
                 camera=DOWN, resolution=(16, 16))  # fmt: skip
    given = 0.5 * (0.5 if own else 4 * 0.5)
    alone = irradiance(below([(other, translation(0.6, 1, 0))]), 256)
    rect = irradiance(below([], [as_rect(given)]), 256)
    assert_same(irradiance(d, 512), (alone[0] + rect[0], math.hypot(alone[1], rect[1]) + 2e-3 * rect[0]))


def test_too_many_to_sample_are_as_bright() -> None:
    rows = np.tile(np.eye(4)[:3], ((1 << 18) + 1, 1, 1))
    rows[:, 0, 3] = 10.0 * np.arange(len(rows))
    shape = wears(lamp_quad(3, 3), 0.4, DARK, own_color=True, normalize=True)
    d = below(
        [], prototypes=[Prototype("/p", (Placed(1, np.eye(4)),))], prototype_shapes=[shape], placements=[placement(0, rows)]
    )

    from primray.core.scene_upload import upload

    scene, warnings, _ = upload(d.description, {}, 1.0, np.zeros(0, np.float32))
    assert [w[0] for w in warnings] == ["emitters-unsampled"]
    pixels = replicate_means(render(scene, 256, max_depth=1))[..., 1] * math.pi
    expected = 0.4 / 9 * irradiances(as_rect(1.0, 3, 3), np.zeros((1, 3)), [0, 1, 0], 400)[0]
    assert pixels.mean() == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("matrix", [np.eye(4), scaling(1, 0.4, 2)])
def test_lanes_do_not_change_bits(matrix: Doubles) -> None:
    shapes = [(wears(s, 0.5, normalize=True), translation(0.3 * i, 1, 0) @ matrix) for i, s in enumerate(SHAPES.values())]
    scene = below(shapes).build()
    assert np.array_equal(render(scene, 16, lanes=1).pixels(), render(scene, 16).pixels())
