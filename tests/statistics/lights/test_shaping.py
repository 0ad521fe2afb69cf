"""Shaped lights: the core against the text's formula in double precision, sampled and met, and on a plane by quadrature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    kernels,
    lambert,
    light,
    look_at,
    mesh,
    orthographic,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.statistics.lights.placed_lights import PLACED, SHEAR, only, patches
from tests.statistics.lights.shaping import shaped
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import Doubles, IesProfile, Light, LightType, Shaping
from primray.textures.ies import profile_power

N = 1500


def profile(verticals: np.ndarray, horizontals: np.ndarray, seed: int, horizontal_pole: bool = False) -> IesProfile:
    c = np.random.default_rng(seed).uniform(0, 3, (len(horizontals), len(verticals)))
    if not horizontal_pole and len(horizontals) > 1:
        c[-1] = c[0]
        for end, angle in ((0, 0.0), (-1, 180.0)):
            if verticals[end] == angle:
                c[:, end] = c[0, end]
    power = profile_power(verticals, horizontals, c, horizontal_pole)
    f = np.float32
    return IesProfile(verticals.astype(f), horizontals.astype(f), c.astype(f), power, horizontal_pole)


ALL_ROUND = profile(np.linspace(0, 180, 19), np.linspace(0, 360, 13), 1)
AXIAL = profile(np.array([0.0, 5, 12, 40, 90]), np.zeros(1), 2)
UPWARD = profile(np.array([90.0, 120, 180]), np.array([0.0, 90, 90, 270, 270, 360]), 3)
TYPE_B = profile(np.linspace(-90, 90, 9), np.linspace(-60, 90, 7), 4, horizontal_pole=True)

SHAPINGS: dict[str, Shaping] = {
    "cone 90": Shaping(cone_angle_deg=90),
    "hard cone": Shaping(cone_angle_deg=25),
    "narrow cone": Shaping(cone_angle_deg=0.5, cone_softness=0.5),
    "soft cone": Shaping(cone_angle_deg=60, cone_softness=1.0),
    "softened cone": Shaping(cone_angle_deg=120, cone_softness=0.3),
    "cone beyond 180": Shaping(cone_angle_deg=250, cone_softness=0.8),
    "focus": Shaping(focus=3.0),
    "weak focus": Shaping(focus=0.01),
    "focus of 1e4": Shaping(focus=1e4),
    "tinted focus": Shaping(focus=12.0, focus_tint=(0.2, 0.9, 1.5)),
    "all but a profile": Shaping(2.0, (0.1, 0.2, 0.0), 70.0, 0.4),
    "profile": Shaping(ies=ALL_ROUND),
    "axial profile": Shaping(ies=AXIAL, ies_normalize=True),
    "upward profile": Shaping(ies=UPWARD),
    "type B": Shaping(ies=TYPE_B),
    "type B, scaled": Shaping(ies=TYPE_B, ies_angle_scale=1.7),
    "narrowed": Shaping(ies=ALL_ROUND, ies_angle_scale=0.4),
    "broadened": Shaping(ies=AXIAL, ies_angle_scale=1.6),
    "narrowed upwards": Shaping(ies=ALL_ROUND, ies_angle_scale=-0.5),
    "broadened upwards": Shaping(ies=UPWARD, ies_angle_scale=-1.4, ies_normalize=True),
    "everything": Shaping(1.5, (0.3, 0.1, 0.8), 100.0, 0.9, ALL_ROUND, 0.8, True),
}
FRAMES: dict[str, Doubles] = {
    "as is": np.eye(4),
    "turned": PLACED,
    "scaled": PLACED @ scaling(2, 0.4, 3),
    "mirrored": PLACED @ scaling(1, -1, 1),
    "sheared": PLACED @ SHEAR,
}


def directions(n: int, seed: int) -> Doubles:
    w = np.random.default_rng(seed).normal(size=(n, 3))
    return (w / np.linalg.norm(w, axis=1)[:, None]).astype(np.float32).astype(np.float64)


def around(axis: Doubles, spread: float, n: int) -> Doubles:
    """Directions within about `spread` of an axis."""
    w = axis + np.random.default_rng(8).normal(size=(n, 3)) * spread
    return (w / np.linalg.norm(w, axis=1)[:, None]).astype(np.float32).astype(np.float64)


def check(got: np.ndarray, x: Light, e: Doubles) -> None:
    """Equal, but where rounding of the angle decides: near a jump, or beside a steep slope."""
    e = e / np.linalg.norm(e, axis=1)[:, None]
    expected = shaped(x, e)
    assert np.isfinite(got).all()
    largest = max(np.abs(expected).max(), 1e-30)
    # What turning the direction a little would change: rounding may do as much.
    nudged = [
        shaped(x, (e + d) / np.linalg.norm(e + d, axis=1)[:, None]) for d in np.concatenate([np.eye(3), -np.eye(3)]) * 3e-6
    ]
    slack = np.max([np.abs(n - expected) for n in nudged], axis=0)
    assert (np.abs(got - expected) <= 2 * slack + 3e-6 * largest + 3e-6 * np.abs(expected)).all()
    assert (slack > 1e-3 * largest).mean() < 0.02


@pytest.mark.conforms("ShapingAPI.inputs:shaping:focus", "ShapingAPI.inputs:shaping:focusTint")
@pytest.mark.conforms("ShapingAPI.inputs:shaping:cone:angle", "ShapingAPI.inputs:shaping:cone:softness")
@pytest.mark.conforms("ShapingAPI.inputs:shaping:ies:file", "ShapingAPI.inputs:shaping:ies:angleScale")
@pytest.mark.conforms("ShapingAPI.inputs:shaping:ies:normalize")
@pytest.mark.parametrize("name", SHAPINGS)
@pytest.mark.parametrize("frame", FRAMES)
def test_factor_of_rays_that_meet_a_light(name: str, frame: str) -> None:
    x = light(LightType.SPHERE, FRAMES[frame], shaping=SHAPINGS[name])
    scene, axis = only(x).build(), -x.world_from_light[:3, 2]
    e = np.concatenate([directions(N, 1), around(axis / np.linalg.norm(axis), 0.01, 500), around(axis, 1e-4, 500)])
    got = kernels().light_shaping(scene, 0, (-e).astype(np.float32))
    check(got.astype(np.float64), x, e)
    assert np.array_equal(got, kernels().light_shaping(scene, 0, (-e).astype(np.float32), 1))


KINDS: dict[str, Light] = {
    "point": light(LightType.POINT, PLACED @ SHEAR, (2.0, 1.0, 0.5)),
    "sphere": light(LightType.SPHERE, PLACED, radius=0.4),
    "ellipsoid": light(LightType.SPHERE, PLACED @ SHEAR, radius=0.4),
    "disk": light(LightType.DISK, PLACED @ scaling(1, 0.3, 1), radius=0.5),
    "rect": light(LightType.RECT, PLACED @ SHEAR, width=0.8, height=0.5),
    "cylinder": light(LightType.CYLINDER, PLACED @ scaling(1.5, 0.7, 0.7), radius=0.2, length=0.8),
    "line": light(LightType.LINE, PLACED @ scaling(1.5, 0.7, 0.1), length=0.8),
}


@pytest.mark.parametrize("kind", KINDS)
def test_samples_carry_the_factor(kind: str) -> None:
    for name, shaping in SHAPINGS.items():
        x = replace(KINDS[kind], shaping=shaping)
        scene, plain = only(x).build(), only(KINDS[kind]).build()
        assert (scene.has_shaping, plain.has_shaping) == (True, False)
        p = np.random.default_rng(5).normal(size=(800, 3)) * 2
        u = random_numbers(800, 2, seed=6)
        wi, t, pdf, L = kernels().light_sample(scene, 0, p, u)
        wi_plain, t_plain, pdf_plain, L_plain = kernels().light_sample(plain, 0, p, u)
        seen = pdf > 0
        assert seen.any(), name
        assert np.array_equal(pdf, pdf_plain)
        assert np.array_equal(wi[seen], wi_plain[seen])
        assert np.array_equal(t[seen], t_plain[seen])
        check(L[seen].astype(np.float64) / L_plain[seen], x, -wi[seen].astype(np.float64))
        for one, many in zip(kernels().light_sample(scene, 0, p, u, 1), (wi, t, pdf, L), strict=True):
            assert np.array_equal(one[seen], many[seen])


@pytest.mark.parametrize("kind", ["sphere", "disk", "cylinder", "rect"])
@pytest.mark.parametrize("name", ["hard cone", "everything", "focus"])
def test_the_camera_sees_the_factor(kind: str, name: str) -> None:
    """Radiance of what camera rays meet, along the camera's own rays; no noise but the pixel's own width."""
    x = replace(KINDS[kind], shaping=SHAPINGS[name])
    center, back = x.world_from_light[:3, 3], x.world_from_light[:3, 2]
    camera = orthographic(look_at(center - 5 * back + [0.9, 0.2, 0.4], center), 1.0)
    scene = describe(lights=[x], camera=camera, resolution=(24, 24)).build()
    pixels = render(scene, 4).pixels()
    d = -camera.world_from_camera[:3, 2]
    lit = pixels[..., 3] == 1  # wholly
    assert lit.sum() > 5
    np.testing.assert_allclose(pixels[lit][:, :3], np.broadcast_to(shaped(x, -d[None]), (lit.sum(), 3)), rtol=3e-5, atol=1e-6)


def emitters(x: Light) -> tuple[Doubles, Doubles | None, Doubles]:
    """Points of the light, outward normals (None: it has no surface) and weights, for radiance or intensity 1."""
    m = x.world_from_light
    if x.type is LightType.POINT:
        return m[:3, 3][None], None, np.ones(1)
    if x.type is LightType.LINE:
        u = (np.arange(200) + 0.5) / 200 - 0.5
        stretched = x.length * float(np.linalg.norm(m[:3, 0]))
        return m[:3, 3] + u[:, None] * x.length * m[:3, 0], None, np.full(200, stretched / 200)
    s = patches(x, 24)
    return s.p, s.n, s.area


def irradiance(x: Light, p: Doubles, n: Doubles) -> Doubles:
    """At one point (3,), by quadrature over the light."""
    at, normals, weight = emitters(x)
    to = at - p
    d = np.linalg.norm(to, axis=1)
    w = to / d[:, None]
    if normals is not None:
        weight = weight * np.maximum(-np.sum(w * normals, axis=1), 0)
    elif x.type is LightType.LINE:
        axis = x.world_from_light[:3, 0] / np.linalg.norm(x.world_from_light[:3, 0])
        weight = weight * np.linalg.norm(np.cross(w, axis), axis=1)
    weight = weight * np.maximum(w @ n, 0) / d**2
    return (weight @ shaped(x, -w) if x.shaping else np.full(3, weight.sum())) * x.emission


OVER = translation(0.2, 6.0, 0.1) @ rotation([1, 0, 0.1], -80)  # above the camera, which does not see the light


def white_plane(lights: Sequence[Light], half: float, resolution: int) -> Described:
    """A white plane y = 0, seen from above."""
    camera = orthographic(look_at((0, 5, 0), (0, 0, 0), up=(0, 0, -1)), half)
    ground = mesh([[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], [[0, 1, 2], [0, 2, 3]])
    return describe([(ground, np.eye(4))], [lambert(1.0)], lights, camera, (resolution, resolution))


@pytest.mark.parametrize(
    ("kind", "name"),
    [("point", "soft cone"), ("sphere", "softened cone"), ("disk", "focus"), ("rect", "profile"), ("cylinder", "hard cone"),
     ("line", "axial profile"), ("ellipsoid", "everything"), ("line", "all but a profile")],
)  # fmt: skip
def test_irradiance_of_a_plane(kind: str, name: str) -> None:
    x = replace(
        KINDS[kind], world_from_light=OVER @ np.linalg.inv(PLACED) @ KINDS[kind].world_from_light, shaping=SHAPINGS[name]
    )
    got = replicate_means(render(white_plane([x], 4.0, 2).build(), 16384, max_depth=1)).mean(axis=0).reshape(-1, 3) * np.pi
    fine = ((np.arange(8) + 0.5) / 8 - 0.5) * 4
    dx, dz = (a.ravel() for a in np.meshgrid(fine, fine))
    inside, up = np.stack([dx, 0 * dx, dz], axis=1), np.array([0.0, 1, 0])
    expected = np.array(
        [np.mean([irradiance(x, d + [cx, 0, cz], up) for d in inside], axis=0) for cz in (-2, 2) for cx in (-2, 2)]
    )
    assert expected.max() > 1e-4
    # The quadrature's own error: a cone's edge cuts through pixels and light.
    np.testing.assert_allclose(got, expected, rtol=0.015, atol=0.008 * expected.max())


@pytest.mark.parametrize("count", [5, 16, 40])
def test_the_choice_leaves_out_no_light_that_reaches_a_point(count: int) -> None:
    """Whatever part of it does, however large it is beside its distance; and spots are chosen where they shine."""
    rng = np.random.default_rng(count)
    kinds, shapings = list(KINDS.values()), list(SHAPINGS.values())
    lights = []
    for i in range(count):
        m = translation(*rng.normal(size=3)) @ rotation(rng.normal(size=3), 360 * rng.random()) @ kinds[i % 7].world_from_light
        lights.append(replace(kinds[i % 7], world_from_light=m, shaping=shapings[i % len(shapings)]))
    scene = describe(lights=lights).build()
    points = rng.normal(size=(400, 3)) * 2
    probability = kernels().light_probabilities(scene, points, np.zeros((400, 3), np.float32)).astype(np.float64)
    total = probability.sum(axis=1)
    assert (total < 1 + 1e-5).all()
    # A cluster of lights may be chosen none of which reaches the point: little is lost so, and nothing by lights one by one.
    whole = (np.abs(total - 1) < 1e-5) | (total == 0)
    assert whole.all() if count <= 16 else total.mean() > 0.98
    for i in range(count):
        for seed in range(12):
            _, _, pdf, L = kernels().light_sample(scene, i, points, random_numbers(400, 2, seed=seed))
            reached = (pdf > 0) & (L.max(axis=1) > 0)
            assert (probability[:, i][reached] > 0).all(), (i, lights[i].type)
    if count <= 16:
        hard = light(LightType.POINT, emission=100.0, shaping=SHAPINGS["hard cone"])
        two = describe(lights=[hard, light(LightType.POINT, translation(0, 0, -9))]).build()
        aside = kernels().light_probabilities(two, np.array([[3.0, 0, -1], [0.1, 0, -3]]), np.zeros((2, 3), np.float32))
        assert aside[0, 0] == 0
        assert aside[1, 0] > 0.9


def test_a_render_by_choice_is_the_sum_of_its_lights() -> None:
    spots = [
        light(LightType.SPHERE, OVER @ translation(x, 0, 0), radius=0.5, shaping=Shaping(cone_angle_deg=a, cone_softness=0.5))
        for x, a in ((-2, 20), (0.5, 40), (1.5, 12))
    ]
    one_by_one = [replicate_means(render(white_plane([x], 4, 4).build(), 2048, max_depth=1)).mean(axis=0) for x in spots]
    together = replicate_means(render(white_plane(spots, 4, 4).build(), 8192, max_depth=1)).mean(axis=0)
    np.testing.assert_allclose(together, np.sum(one_by_one, axis=0), rtol=0.02, atol=0.01 * together.max())


@pytest.mark.parametrize(
    "shaping",
    [
        Shaping(cone_angle_deg=0), Shaping(cone_angle_deg=0, cone_softness=1), Shaping(cone_angle_deg=-5),
        Shaping(cone_angle_deg=1e-30, cone_softness=1e-30), Shaping(cone_angle_deg=1e30, cone_softness=1),
        Shaping(focus=1e38, focus_tint=(1, 1, 1)), Shaping(focus=1e-38), Shaping(ies=AXIAL, ies_angle_scale=1e-30),
        Shaping(ies=AXIAL, ies_angle_scale=-1e-30), Shaping(ies=TYPE_B, ies_angle_scale=1e30),
    ],
)  # fmt: skip
def test_extremes_are_finite(shaping: Shaping) -> None:
    axes = np.concatenate([np.eye(3), -np.eye(3), directions(500, 3)])
    for kind in KINDS.values():
        scene = only(replace(kind, shaping=shaping)).build()
        factor = kernels().light_shaping(scene, 0, axes.astype(np.float32))
        assert np.isfinite(factor).all()
        assert (factor >= 0).all()
        assert np.isfinite(render(scene, 4).pixels()).all()
    if shaping.cone_angle_deg <= 0 and shaping.cone_softness:
        assert not factor.any()


def test_a_line_is_the_limit_of_cylinders() -> None:
    """Of radius r and radiance 1 / (2 r): intensity 1 by length across it. Near and far, beside and beyond its ends."""
    m, r = PLACED @ scaling(1.7, 1, 1), 1e-4
    line = light(LightType.LINE, m, length=0.9)
    cylinder = light(LightType.CYLINDER, m, 1 / (2 * r), radius=r, length=0.9)
    local = np.array([[0, 0.1, 0], [0.3, 0.02, 0.05], [0.44, 0, 0.4], [2, 0.1, 0.3], [-3, 0, 0.05], [0, 30, 40], [50, 1, 0]])
    p = local @ m[:3, :3].T + m[:3, 3]
    grid = (np.arange(128) + 0.5) / 128
    u = np.stack([a.ravel() for a in np.meshgrid(grid, grid)], axis=1).astype(np.float32)
    n = len(u)
    for point in p:
        rows = np.ascontiguousarray(np.broadcast_to(point, (n, 3)))
        sums = []
        for x in (line, cylinder):
            wi, t, pdf, L = kernels().light_sample(only(x).build(), 0, rows, u)
            weight = np.where(pdf > 0, L[:, 0] / np.maximum(pdf, 1e-30), 0).astype(np.float64)
            sums.append([weight.mean(), *(weight @ wi / n), (weight * t).mean()])
        np.testing.assert_allclose(sums[0], sums[1], rtol=0.01, atol=0.005 * sums[1][0])
    # Rays never meet it.
    assert (
        kernels().light_hit(only(line).build(), 0, np.repeat(p[:1], 500, 0), directions(500, 9).astype(np.float32))[1] == 0
    ).all()
