"""Photons in bodies of glass and wine: their flux and their directions by closed forms, and pictures that keep their means."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from tests.described import (
    ISAS,
    Described,
    box,
    core_module,
    describe,
    ground,
    kernels,
    lambert,
    light,
    look_at,
    perspective,
    render,
    replicate_means,
    rotation,
    translation,
)

from primray import core
from primray.description import Doubles, HomogeneousVolume, Light, LightType, Mesh, OpenPbr, Shape, Sphere, Surface

from .photon_guides import assert_mean_is_kept_with_less_noise

DEPTH = 10
GLASS, WINE = 1.5, 1.34
RED = (0.9, 0.3, 0.1)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
CAMERA = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
DOWN = rotation((1, 0, 0), -90)


def body(ior: float, color: tuple[float, float, float] = (1, 1, 1), priority: float = 0.0) -> Surface:
    """Smooth glass; light has `color` after a way of 1."""
    lobes = OpenPbr(
        transmission_weight=1.0, transmission_color=color, transmission_depth=1.0, specular_roughness=0.0, specular_ior=ior
    )
    return Surface(f"/body{ior}", open_pbr=lobes, dielectric_priority=priority)


def sun(towards: Doubles = DOWN, emission: float | tuple[float, float, float] = 3.0) -> Light:
    return light(LightType.DISTANT, towards, emission=emission, angle_deg=0.3)


def reflected(n: float) -> float:
    return ((n - 1) / (n + 1)) ** 2


def photons(scene: Any) -> tuple[Doubles, Doubles, Doubles]:
    found = kernels().photons(scene, DEPTH, 1)
    assert len(found[2]) > 1000
    return found


def slab(color: tuple[float, float, float], lights: Sequence[Light], ior: float = GLASS) -> Any:
    """A slab of 2 x 0.4 x 2 above the ground."""
    shapes: list[tuple[Shape, Doubles]] = [(ground(6.0), np.eye(4)), (box((2, 0.4, 2), 1), translation(0, 1, 0))]
    return describe(shapes, [lambert(0.5), body(ior, color)], lights, CAMERA, (32, 32)).build()


@pytest.mark.parametrize("color", [(1.0, 1.0, 1.0), RED, (0.02, 0.02, 0.02)])
@pytest.mark.parametrize("shines", [(1.0, 1.0, 1.0), (1.0, 0.1, 0.1)])
def test_flux_through_a_slab_is_that_of_fresnel_and_beer(
    color: tuple[float, float, float], shines: tuple[float, float, float]
) -> None:
    """Relative to that of the light without it: light that is reflected inside comes out as well, or goes back."""
    _, direction, weight = photons(slab(color, [sun(emission=shines)]))
    assert direction[:, 1].min() > 0.999
    r, left = reflected(GLASS), np.array(color) ** 0.4
    through = (1 - r) ** 2 * left / (1 - r**2 * left**2)
    emitted = LUMINANCE * np.array(shines)
    assert weight.sum() == pytest.approx(2 * 2 * (through @ emitted) / emitted.sum(), rel=0.02)


def stacked(towards: Doubles, floor: Mesh) -> Any:
    """A slab of glass from 0.8 to 1, and wine from 0.4 to 0.9, of lower priority: its surface is at 0.8."""
    shapes: list[tuple[Shape, Doubles]] = [
        (floor, translation(0, 0.5, 0)),
        (ground(6.0), np.eye(4)),
        (box((2, 0.2, 2), 1), translation(0, 0.9, 0)),
        (box((2, 0.5, 2), 2), translation(0, 0.65, 0)),
    ]
    surfaces = [lambert(0.5), body(GLASS, (0.5, 0.8, 0.6), priority=1), body(WINE, RED)]
    return describe(shapes, surfaces, [sun(towards)], CAMERA, (32, 32)).build()


def test_flux_through_glass_over_wine_is_that_of_three_interfaces() -> None:
    """Each of the two bodies is a target whose photons go through both, so that the sum is twice the light."""
    _, _, weight = photons(stacked(DOWN, ground(0.01)))
    interfaces = np.prod([1 - reflected(n) for n in (GLASS, GLASS / WINE, WINE)])
    left = np.array((0.5, 0.8, 0.6)) ** 0.2 * np.array(RED) ** 0.4
    assert weight.sum() == pytest.approx(2 * 4 * interfaces * (LUMINANCE @ left), rel=0.03)


def test_light_is_refracted_by_the_ratio_of_both_bodies() -> None:
    """On a floor within the wine, parallel slabs leave the angle that the wine alone would bring about."""
    landing, direction, _ = photons(stacked(rotation((1, 0, 0), -45), ground(0.5)))
    inside = (np.abs(landing[:, 1] - 0.5) < 1e-3) & (np.abs(landing[:, [0, 2]]).max(axis=1) < 0.3)
    assert inside.sum() > 200
    sine = np.linalg.norm(direction[inside][:, [0, 2]], axis=1)
    assert np.median(sine) == pytest.approx(np.sin(np.radians(45)) / WINE, rel=0.005)


def test_a_lamp_within_bodies_starts_in_them() -> None:
    """In the middle of wine in a ball of glass: its light leaves radially, through both."""
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (Sphere("/glass", 0.2, 1), translation(0, 1, 0)),
        (Sphere("/wine", 0.1, 2), translation(0, 1, 0)),
    ]
    lamp = light(LightType.SPHERE, translation(0, 1, 0), 100.0, radius=0.005)
    flux = []
    for wine in (RED, (1.0, 1.0, 1.0)):
        thick = tuple(c**10 for c in wine)
        surfaces = [lambert(0.5), body(GLASS), body(WINE, thick)]  # type: ignore[arg-type]
        flux.append(photons(describe(shapes, surfaces, [lamp], CAMERA, (32, 32)).build())[2].sum())
    assert flux[0] / flux[1] == pytest.approx(LUMINANCE @ np.array(RED), rel=0.02)


def test_boundaries_of_volumes_are_passed_and_attenuate() -> None:
    """Below the slab, a box without an interface whose medium halves the light twice."""
    air = Surface("/air", volume=HomogeneousVolume(path="/air", extinction=(2.0, 2.0, 2.0)), interface=False)
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (box((2, 0.4, 2), 1), translation(0, 1, 0)),
        (box((3, 0.5, 3), 2), translation(0, 0.5, 0)),
    ]
    _, _, weight = photons(describe(shapes, [lambert(0.5), body(GLASS), air], [sun()], CAMERA, (32, 32)).build())
    r = reflected(GLASS)
    assert weight.sum() == pytest.approx(4 * (1 - r) / (1 + r) * np.exp(-1), rel=0.03)


def glasses(lights: Sequence[Light]) -> Described:
    """Wine in a ball of glass, a dark ball, and a block of coloured glass, on the ground."""
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (Sphere("/glass", 0.5, 1), translation(-0.8, 0.5, 0)),
        (Sphere("/wine", 0.42, 2), translation(-0.8, 0.5, 0)),
        (Sphere("/dark", 0.4, 3), translation(0.5, 0.4, 0.5)),
        (box((0.6, 0.6, 0.4), 4), translation(0.7, 0.31, -0.5) @ rotation((0, 1, 0), 20)),
    ]
    surfaces = [
        lambert(0.5),
        body(GLASS, priority=1),
        body(WINE, (0.6, 0.05, 0.08)),
        body(1.6, (0.02, 0.03, 0.02)),
        body(1.45, (0.2, 0.4, 0.9)),
    ]
    return describe(shapes, surfaces, lights, CAMERA, (32, 32))


LIGHTS = (
    light(LightType.DISTANT, rotation((1, 0, 0), -60), emission=400.0, angle_deg=2.0),
    light(LightType.DOME, emission=0.1),
)


def test_pictures_keep_their_mean_and_lose_noise() -> None:
    scene = glasses(LIGHTS).build()
    guide = kernels().find_caustics(scene, DEPTH, 1)
    assert_mean_is_kept_with_less_noise(scene, guide, 512, DEPTH)  # 0.64 of the noise when this was written


@pytest.mark.parametrize("isa", ISAS)
def test_bits_do_not_depend_on_threads_or_lanes(isa: str) -> None:
    scene = glasses(LIGHTS).build(isa)
    most = core_module(isa).MAX_LANES
    images = set()
    for learning, lanes, threads in ((1, most, 1), (3, 1, 2), (2, 4, 3)):
        guide = core_module(isa).testing.find_caustics(scene, DEPTH, learning)
        picture = render(scene, 40, isa=isa, max_depth=DEPTH, lanes=lanes, threads=threads, splits=2, caustics=guide)
        images.add(picture.replicates.tobytes())
    assert len(images) == 1


def test_a_pass_in_two_parts_has_the_same_bits() -> None:
    scene = glasses(LIGHTS).build()
    guide = kernels().find_caustics(scene, DEPTH, 1)
    whole = render(scene, 70, max_depth=DEPTH, splits=4, caustics=guide)
    part = render(scene, 32, max_depth=DEPTH, splits=4, caustics=guide)
    rest = render(scene, 70, max_depth=DEPTH, splits=4, caustics=guide, film=part.film)
    assert np.array_equal(rest.replicates, whole.replicates)


def coloured_balls() -> Described:
    """Balls of coloured glass under a lamp, which each of them mirrors as a speck that hardly any ray of the floor meets."""

    def ball(at: tuple[float, float, float], radius: float, surface: int) -> tuple[Shape, Doubles]:
        return Sphere(f"/ball{at}", radius, surface), translation(*at)

    shapes: list[tuple[Shape, Doubles]] = [
        (ground(3.0), np.eye(4)),
        (ground(3.0), translation(0, 2, -1.5) @ rotation((1, 0, 0), 90)),
        *(ball((0.75 * k - 0.75, 0.3, 0), 0.3, k + 1) for k in range(3)),
        ball((0.3, 0.25, 0.6), 0.25, 4),
        ball((0.3, 0.25, 0.6), 0.15, 1),
    ]
    colors = ((0.7, 5e-4, 5e-5), (1e-17, 1e-13, 6e-3), (3e-9, 2e-8, 3e-9), (1.0, 1.0, 1.0))
    surfaces = [lambert(0.74), *(body(ior, color) for ior, color in zip((1.5, 1.6, 1.5, 1.45), colors, strict=True))]
    lamp = light(LightType.SPHERE, translation(-0.6, 2.4, 1.2), 4000.0, radius=0.05)
    return describe(shapes, surfaces, [lamp], perspective(look_at([0, 1.6, 3.0], [0, 0.2, 0]), 0.6), (48, 27))


def test_light_that_hardly_any_picture_shows_is_no_reason_for_photons() -> None:
    """The variance of all that photons guide would be 50 times as large without them; pictures have less noise then."""
    scene = coloured_balls().build()
    guide = kernels().find_caustics(scene, 8, 1)
    assert guide is not None
    noise = []
    for caustics in (guide, None):
        pictures = [render(scene, 64, max_depth=8, seed=s, splits=2, caustics=caustics) for s in range(6)]
        halves = np.concatenate([replicate_means(picture) for picture in pictures])
        noise.append(np.median(halves.var(axis=0, ddof=1) / (halves.mean(axis=0) ** 2 + 0.01)))
    assert noise[1] < 0.8 * noise[0]
    assert core.module().learn_caustics(scene, 8, 1, core.lanes()) is None
