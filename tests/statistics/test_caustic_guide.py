"""Rays guided into caustics: drawn by their density, which sums to one; pictures keep mean and bits, with less noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
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
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces.surface_cases import random_numbers

from primray import core
from primray.arrays import Floats
from primray.description import Doubles, Light, LightType, OpenPbr, Shape, Sphere, Surface
from primray.settings import QUICK_LOOK, RenderSettings

from .photon_guides import assert_mean_is_kept_with_less_noise

N = 40_000
GLASS = Surface("/glass", diffuse_color=(1, 1, 1), roughness=0.0, opacity=0.0, ior=1.5)
METAL = Surface("/metal", diffuse_color=(0.9, 0.8, 0.6), metallic=1.0, roughness=0.1)
DEPTH = 6


def sky(sun: float) -> Any:
    """Dim, but for a sun of two degrees, 50 degrees high."""
    image = np.full((128, 256, 3), 0.2, np.float32)
    image[28:30, 100:102] = sun
    return image


def balls(sun: float = 2000.0) -> Described:
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (Sphere("/ball", 0.5, 1), translation(-0.7, 0.5, 0)),
        (Sphere("/other", 0.5, 2), translation(0.7, 0.5, 0)),
    ]
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    return describe(shapes, [lambert(0.5), GLASS, METAL], [light(LightType.DOME)], camera, (32, 32), dome_texture=sky(sun))


@cache
def learnt(threads: int = 1, isa: str | None = None) -> tuple[Any, Any]:
    """The scene and its guide."""
    scene = balls().build(isa)
    return scene, core_module(isa).testing.find_caustics(scene, DEPTH, threads)


def lit_points(guide: Any, scene: Any, count: int) -> Doubles:
    """Of a grid on the ground, those with the largest guided share."""
    at = np.stack(np.meshgrid(np.linspace(-3, 3, 160), [0.0], np.linspace(-3, 3, 160)), axis=-1).reshape(-1, 3)
    zero = np.zeros((len(at), 3), np.float32)
    share, *_ = kernels().caustic_lobes(scene, guide, at, zero, zero)
    return at[np.argsort(-share)[:count]]


def test_samples_follow_the_density() -> None:
    scene, guide = learnt()
    assert guide.photons > 1000
    assert guide.memory_bytes > 24 * guide.photons
    for point in lit_points(guide, scene, 40)[::20]:
        p = np.ascontiguousarray(np.broadcast_to(point, (N, 3)))
        u = random_numbers(N, 3, seed=5)
        share, wi, pdf, _ = kernels().caustic_lobes(scene, guide, p, u, u)
        assert (share > 0.1).all()
        assert (share <= 0.5).all()
        assert (pdf > 0).all()

        def density(w: Doubles, at: Doubles = point) -> Doubles:
            there = np.ascontiguousarray(np.broadcast_to(at, (len(w), 3)))
            given = w.astype(np.float32)
            found: Doubles = kernels().caustic_lobes(scene, guide, there, np.zeros_like(given), given)[3]
            return found

        toward = np.mean(wi, axis=0, dtype=np.float64)
        cells = SphereCells(toward / np.linalg.norm(toward), spread=np.pi, growth=3, rings=24, points=40)
        assert density_p_value(cells, density, wi, N) > 0.005


def test_points_of_one_leaf_together_have_the_bits_of_points_of_many() -> None:
    """Packets of four lanes: four times one point, whose leaf's photons are broadcast, or four points from anywhere."""
    scene, guide = learnt()
    points = lit_points(guide, scene, 400)
    u, given = random_numbers(400, 3, seed=6), random_numbers(400, 3, seed=7)
    apart = kernels().caustic_lobes(scene, guide, points, u, given)
    assert apart[0].min() < apart[0].max()
    together = kernels().caustic_lobes(scene, guide, *(np.repeat(x, 4, axis=0) for x in (points, u, given)))
    for one, same in zip(apart, together, strict=True):
        assert same[::4].tobytes() == one.tobytes()


def test_lobes_follow_the_light_as_points_move() -> None:
    """A flat mirror shows a sun from one direction wherever it is seen: lobes are little wider than the sun."""
    mirror = replace(METAL, roughness=0.0)
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (ground(1.0, 1), translation(0, 1.01, 0) @ rotation((1, 0, 0), 90)),
    ]
    angle_deg = 1.0
    sun = light(LightType.DISTANT, rotation((1, 0, 0), -45), emission=3.0, angle_deg=angle_deg)
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    scene = describe(shapes, [lambert(0.5), mirror], [sun], camera, (32, 32)).build()
    guide = kernels().find_caustics(scene, DEPTH, 1)
    seen = np.array([0, 0.5, -0.5]) * np.sqrt(2)  # of a sun in the direction (0, 1, 1), in a mirror that faces +z
    points = np.stack(np.meshgrid(np.linspace(-0.8, 0.8, 9), [0.0], np.linspace(0.3, 1.7, 9)), axis=-1).reshape(-1, 3)
    toward = np.ascontiguousarray(np.broadcast_to(seen, points.shape).astype(np.float32))
    share, _, _, density = kernels().caustic_lobes(scene, guide, points, np.zeros_like(toward), toward)
    assert (share > 0.4).all()
    sun_sr = 2 * np.pi * (1 - np.cos(np.radians(angle_deg / 2)))
    # 0.41 and 0.78 when this was written; 0.06 and 0.28 without gradients.
    assert np.percentile(density, 10) * sun_sr > 0.2
    assert np.median(density) * sun_sr > 0.5


def floor_below_lamp() -> tuple[Doubles, Floats]:
    """Points (N, 3) of the ground, and unit directions from them to a lamp at a height of 1."""
    points = np.stack(np.meshgrid(np.linspace(-1, 1, 7), [0.0], np.linspace(-1, 1, 7)), axis=-1).reshape(-1, 3)
    toward = np.array([0, 1, 0]) - points
    return points, np.ascontiguousarray((toward / np.linalg.norm(toward, axis=1, keepdims=True)).astype(np.float32))


def globe() -> Described:
    """A lamp in a ball of glass, above the ground."""
    shapes: list[tuple[Shape, Doubles]] = [(ground(6.0), np.eye(4)), (Sphere("/globe", 0.2, 1), translation(0, 1, 0))]
    lamp = light(LightType.SPHERE, translation(0, 1, 0), 100.0, radius=0.02)
    return describe(shapes, [lambert(0.5), GLASS], [lamp], perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35), (16, 16))


def test_a_lamp_in_a_globe_is_found() -> None:
    """Light leaves it radially, so that lobes point to its middle, and little of it is lost."""
    scene = globe().build()
    guide = kernels().find_caustics(scene, DEPTH, 1)
    assert guide is not None
    points, toward = floor_below_lamp()
    share, _, _, density = kernels().caustic_lobes(scene, guide, points, np.zeros_like(toward), toward)
    assert (share > 0.3).all()
    lamp_sr = np.pi * 0.02**2 / (1 + (points**2).sum(axis=1))
    assert np.median(density * lamp_sr) > 0.1
    guided, plain = (replicate_means(render(scene, 256, max_depth=DEPTH, splits=1, caustics=c)) for c in (guide, None))
    means, noise = guided.mean(axis=0), guided.std(axis=0)
    assert np.median(noise / means) < 0.1
    assert np.median(plain.mean(axis=0)) < 0.1 * np.median(means)  # which hardly any ray finds


@pytest.mark.parametrize("roughness", [0.5, 0.7])
def test_a_lamp_in_a_globe_of_frosted_glass_is_found(roughness: float) -> None:
    """Light samples stop at its two walls, and photons pass them. Noise was 0.44 and 0.51 of that without."""
    frosted = OpenPbr(transmission_weight=1.0, specular_roughness=roughness, specular_ior=1.5)
    hollow = OpenPbr(transmission_weight=1.0, specular_roughness=roughness, specular_ior=1.0)
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (Sphere("/outer", 0.2, 1), translation(0, 1, 0)),
        (Sphere("/inner", 0.19, 2), translation(0, 1, 0)),
    ]
    surfaces = [
        lambert(0.5),
        Surface("/frosted", open_pbr=frosted),
        Surface("/hollow", open_pbr=hollow, dielectric_priority=1.0),
    ]
    lamp = light(LightType.SPHERE, translation(0, 1, 0), 100.0, radius=0.03)
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    scene = describe(shapes, surfaces, [lamp], camera, (16, 16)).build()
    guide = core.module().learn_caustics(scene, DEPTH, 1, core.lanes())
    assert guide is not None
    assert_mean_is_kept_with_less_noise(scene, guide, 256, DEPTH)


def test_a_lamp_that_is_a_mesh_is_found() -> None:
    """Its light leaves a ball of glass, where hardly any ray finds it by chance, and crosses one beside it."""
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(6.0), np.eye(4)),
        (box((0.04, 0.04, 0.04), 2), translation(0, 1, 0)),
        (Sphere("/globe", 0.2, 1), translation(0, 1, 0)),
        (Sphere("/ball", 0.2, 1), translation(0.6, 0.5, 0)),
    ]
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    scene = describe(shapes, [lambert(0.5), GLASS, lambert(0.0, 100.0)], [], camera, (16, 16)).build()
    guide = kernels().find_caustics(scene, DEPTH, 1)
    assert guide is not None
    points, toward = floor_below_lamp()
    share, _, _, _ = kernels().caustic_lobes(scene, guide, points, np.zeros_like(toward), toward)
    assert (share > 0.2).all()
    assert_mean_is_kept_with_less_noise(scene, guide, 256, DEPTH)  # 0.2 of the noise when this was written


def test_photons_of_a_floor_are_found_beside_a_wall() -> None:
    """All photons of the floor have one height, and so would the cut of most by height, which those on the wall suggest."""
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(3.0), np.eye(4)),
        (ground(6.0), translation(0, 0, -2.5) @ rotation((1, 0, 0), 90)),
        (Sphere("/globe", 0.2, 1), translation(0, 1, 0)),
    ]
    lamp = light(LightType.SPHERE, translation(0, 1, 0), 100.0, radius=0.02)
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    scene = describe(shapes, [lambert(0.5), GLASS], [lamp], camera, (16, 16)).build()
    guide = kernels().find_caustics(scene, DEPTH, 1)
    points = np.stack(np.meshgrid(np.linspace(-1.5, 1.5, 31), [0.0], np.linspace(-1.5, 1.5, 31)), axis=-1).reshape(-1, 3)
    up = np.ascontiguousarray(np.broadcast_to(np.array([0, 1, 0], np.float32), points.shape))
    share, _, _, _ = kernels().caustic_lobes(scene, guide, points, np.zeros_like(up), up)
    assert (share > 0.3).all()


def test_light_through_water_is_found_everywhere() -> None:
    """The lamp is within the water's bounds, whose bottom is a little above the ground: no spot below it is left out."""
    water = Sphere("/water", 2.0, 1)
    flat = translation(0, 0.26, 0) @ np.diag([1, 0.125, 1, 1])  # a lens of water, 0.01 above the ground
    shapes: list[tuple[Shape, Doubles]] = [(ground(6.0), np.eye(4)), (water, flat)]
    lamp = light(LightType.SPHERE, translation(0.2, 1.5, 0.1), 100.0, radius=0.04)
    camera = perspective(look_at([0, 4.0, 4.0], [0, 0, 0]), 0.35)
    scene = describe(shapes, [lambert(0.5), replace(GLASS, ior=1.33)], [lamp], camera, (16, 16)).build()
    guide = kernels().find_caustics(scene, DEPTH, 1)
    points = np.stack(np.meshgrid(np.linspace(-1, 1, 9), [0.0], np.linspace(-1, 1, 9)), axis=-1).reshape(-1, 3)
    up = np.ascontiguousarray(np.broadcast_to(np.array([0, 1, 0], np.float32), points.shape))
    share, _, _, _ = kernels().caustic_lobes(scene, guide, points, np.zeros_like(up), up)
    assert (share > 0.3).all()


def test_pictures_keep_their_mean_and_lose_noise() -> None:
    scene, guide = learnt()
    assert_mean_is_kept_with_less_noise(scene, guide, 256, DEPTH)  # 0.65 of the noise when this was written


@pytest.mark.parametrize("isa", ISAS)
def test_bits_do_not_depend_on_threads_or_lanes(isa: str) -> None:
    most = core_module(isa).MAX_LANES
    images = []
    for learning, lanes, threads in ((1, most, 1), (3, 1, 2), (3, most, 3)):
        scene, guide = learnt(learning, isa)
        picture = render(scene, 40, isa=isa, max_depth=DEPTH, lanes=lanes, threads=threads, splits=2, caustics=guide)
        images.append(picture.replicates.tobytes())
    assert len(set(images)) == 1
    assert render(learnt(1, isa)[0], 40, isa=isa, max_depth=DEPTH, splits=2).replicates.tobytes() not in images


def test_a_pass_in_two_parts_has_the_same_bits() -> None:
    scene, guide = learnt()
    whole = render(scene, 70, max_depth=DEPTH, splits=4, caustics=guide)
    part = render(scene, 32, max_depth=DEPTH, splits=4, caustics=guide)
    rest = render(scene, 70, max_depth=DEPTH, splits=4, caustics=guide, film=part.film)
    assert np.array_equal(rest.replicates, whole.replicates)


def without(surface: Surface | None = None, lights: Sequence[Light] | None = None) -> Any:
    described = balls()
    d = described.description
    surfaces = d.surfaces if surface is None else (d.surfaces[0], surface, surface)
    changed = replace(d, surfaces=surfaces, lights=d.lights if lights is None else tuple(lights))
    return kernels().find_caustics(replace(described, description=changed).build(), DEPTH, 1)


def test_nothing_is_found_where_no_small_light_meets_a_smooth_surface() -> None:
    scene, _ = learnt()
    assert kernels().find_caustics(scene, 1, 1) is None
    assert without(surface=lambert(0.5)) is None
    assert without(surface=replace(METAL, roughness=0.5)) is None
    assert without(lights=[light(LightType.DOME)]) is None
    assert without(lights=[light(LightType.DISTANT, emission=3.0, angle_deg=2.0)]) is not None


@pytest.mark.parametrize(("sun", "pays"), [(2000.0, True), (200.0, True), (5.0, False)])
def test_photons_that_would_not_pay_are_not_used(sun: float, pays: bool) -> None:
    """They cost about 1.4 times the seconds; of the error 0.46, 0.56 and 2.2 when this was written."""
    scene = balls(sun).build()
    found = kernels().find_caustics(scene, DEPTH, 1)
    assert found is not None
    errors = []
    for use in (found, None):
        pictures = [render(scene, 64, max_depth=DEPTH, seed=seed, splits=1, caustics=use) for seed in range(6)]
        halves = np.concatenate([replicate_means(picture) for picture in pictures])
        errors.append((halves.var(axis=0, ddof=1) / (halves.mean(axis=0) ** 2 + 0.01)).mean())
    assert bool(errors[0] * 1.4 < errors[1]) is pays
    for lanes in (1, core.lanes()):
        used = core.module().learn_caustics(scene, DEPTH, 1, lanes)
        assert (used is not None) is pays


def test_the_report_tells_of_it_and_quick_looks_do_without() -> None:
    scene = core.CoreScene(balls().build(), 1.0, [], (32, 32))
    settings = RenderSettings(spp=QUICK_LOOK, max_depth=DEPTH, threads=1)
    bytes_before = scene.memory_bytes
    assert scene.caustics(replace(settings, spp=QUICK_LOOK - 1)) is None
    assert not any("caustics" in row["name"] for row in scene.features)
    guide = scene.caustics(settings)
    assert guide is not None
    assert scene.caustics(settings) is guide
    told = [row for row in scene.features if "caustics" in row["name"]]
    assert told == [{"name": f"caustics guided by {guide.photons} photons", "why": "small lights shine on metal or glass"}]
    assert scene.memory_bytes == bytes_before + guide.memory_bytes
    film = core.render(scene, settings)
    plain = render(scene._scene, QUICK_LOOK, max_depth=DEPTH)
    assert not np.array_equal(film.replicates, plain.replicates)
