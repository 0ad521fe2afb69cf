"""Shaped lights: the core against the text's formula in double precision, sampled and met, and on a plane by quadrature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
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
from tests.statistics.lights import PLACED, SHEAR, only, patches
from tests.statistics.shaping import shaped
from tests.statistics.surfaces import random_numbers

from primray.description import Doubles, IesProfile, Light, LightType, Shaping
from primray.ies import profile_power

N = 4000


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
    e = np.concatenate([directions(N, 1), around(axis / np.linalg.norm(axis), 0.01, 2000), around(axis, 1e-4, 2000)])
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
        assert scene.has_shaping and not plain.has_shaping
        p = np.random.default_rng(5).normal(size=(3000, 3)) * 2
        u = random_numbers(3000, 2, seed=6)
        wi, t, pdf, L = kernels().light_sample(scene, 0, p, u)
        wi_plain, t_plain, pdf_plain, L_plain = kernels().light_sample(plain, 0, p, u)
        seen = pdf > 0
        assert seen.any() and np.array_equal(pdf, pdf_plain), name
        assert np.array_equal(wi[seen], wi_plain[seen]) and np.array_equal(t[seen], t_plain[seen])
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


def lit_plane(x: Light, points: Doubles, n: Doubles) -> Doubles:
    """Irradiance (N, 3) by the area quadrature of lights.patches, with the factor."""
    if x.type in (LightType.POINT, LightType.LINE):
        return np.stack([_irradiance_of_thin(x, p, n) for p in points])
    s, result = patches(x, 300), []
    for p in points:
        to = s.p - p
        d2 = np.sum(to * to, axis=1)
        w = to / np.sqrt(d2)[:, None]
        weight = np.maximum(w @ n, 0) * np.maximum(-np.sum(w * s.n, axis=1), 0) * s.area / d2
        result.append(weight @ shaped(x, -w) if x.shaping else np.full(3, weight.sum()))
    return np.array(result)


def _irradiance_of_thin(x: Light, p: Doubles, n: Doubles, steps: int = 20_000) -> Doubles:
    m = x.world_from_light
    if x.type is LightType.POINT:
        at, weight = m[:3, 3][None], np.ones(1)
    else:
        u = (np.arange(steps) + 0.5) / steps - 0.5
        at, weight = m[:3, 3] + u[:, None] * x.length * m[:3, 0], np.full(steps, x.length * np.linalg.norm(m[:3, 0]) / steps)
    to = at - p
    d = np.linalg.norm(to, axis=1)
    w = to / d[:, None]
    if x.type is LightType.LINE:
        axis = m[:3, 0] / np.linalg.norm(m[:3, 0])
        weight = weight * np.linalg.norm(np.cross(w, axis), axis=1)
    weight = weight * np.maximum(w @ n, 0) / d**2
    return (weight @ shaped(x, -w) if x.shaping else np.full(3, weight.sum())) * x.emission


def on_a_plane(lights: list[Light], half: float, resolution: int, spp: int) -> tuple[np.ndarray, np.ndarray]:
    """Replicate means over the pixels of a white plane y = 0 seen from above, and the pixels' centres."""
    camera = orthographic(look_at((0, 5, 0), (0, 0, 0), up=(0, 0, -1)), half, clipping_range=(1e-3, 4.999999e6))
    ground = mesh([[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], [[0, 1, 2], [0, 2, 3]])
    hidden = [replace(x, world_from_light=x.world_from_light) for x in lights]
    scene = describe([(ground, np.eye(4))], [lambert(1.0)], hidden, camera, (resolution, resolution)).build()
    means = replicate_means(render(scene, spp, max_depth=1))
    c = (np.arange(resolution) + 0.5) / resolution * 2 - 1
    x, z = np.meshgrid(c * half, c * half)
    return means, np.stack([x, np.zeros_like(x), z], axis=-1)


OVER = translation(0.2, 6.0, 0.1) @ rotation([1, 0, 0.1], -80)  # above the camera, so that it does not see the light


@pytest.mark.parametrize(
    ("kind", "name"),
    [("point", "soft cone"), ("sphere", "softened cone"), ("disk", "focus"), ("rect", "profile"), ("cylinder", "hard cone"),
     ("line", "axial profile"), ("ellipsoid", "everything"), ("line", "all but a profile")],
)  # fmt: skip
def test_irradiance_of_a_plane(kind: str, name: str) -> None:
    base = KINDS[kind]
    frame = np.linalg.inv(PLACED) @ base.world_from_light
    x = replace(base, world_from_light=OVER @ frame, shaping=SHAPINGS[name])
    means, points = on_a_plane([x], 4.0, 4, 8192)
    fine = (np.arange(12) + 0.5) / 12 - 0.5
    dx, dz = (a.ravel() * 2.0 for a in np.meshgrid(fine, fine))
    expected = np.stack(
        [
            lit_plane(x, p + np.stack([dx, 0 * dx, dz], axis=1), np.array([0.0, 1, 0])).mean(axis=0)
            for p in points.reshape(-1, 3)
        ]
    )
    got = means.mean(axis=0).reshape(-1, 3) * np.pi
    assert expected.max() > 1e-4
    np.testing.assert_allclose(got, expected, rtol=0.02, atol=0.004 * expected.max())
    assert got.mean() == pytest.approx(expected.mean(), rel=0.003)
