"""Sampling of every light against the density of a ray that meets it, and against its solid angle from UsdLux's text."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.described import describe, kernels, lambert, light, mesh, rotation, translation
from tests.statistics.chi_square import SphereCells, count_p_value, density_p_value
from tests.statistics.lights.placed_lights import LIGHTS, PLACED, VIEWS, only, parameters, patches, view_point
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import Light, LightType
from primray.description.lighting import Shadow

FLAT = (LightType.DISK, LightType.RECT)
N = 40_000


def is_seen(x: Light, view: str) -> bool:
    if x.type is LightType.DISTANT:
        return view == "near"
    if view == "inside" and x.type not in FLAT:
        return x is LIGHTS["small sphere"]
    return not (view == "behind" and x.type in FLAT)


CASES = [(name, view) for name, x in LIGHTS.items() for view in VIEWS if is_seen(x, view)]
SIGNIFICANCE = 0.01 / (len(CASES) + 8)  # Bonferroni: 1 % over all cases of this file


def rows(p: np.ndarray, n: int) -> np.ndarray:
    return np.ascontiguousarray(np.broadcast_to(p, (n, 3)), np.float64)


CELLS = 20  # of each parameter of a light's surface


def seen_patches(x: Light, p: np.ndarray, steps: int, steps_v: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Directions to the pieces of the light, and their solid angles, 0 where they face away."""
    s = patches(x, steps, steps_v)
    to = s.p - p
    d2 = np.sum(to * to, axis=1)
    w = to / np.sqrt(d2)[:, None]
    return w, np.maximum(-np.sum(w * s.n, axis=1), 0) * s.area / d2


@pytest.mark.parametrize(("name", "view"), CASES)
def test_samples_follow_the_density(name: str, view: str) -> None:
    x = LIGHTS[name]
    scene, p = only(x).build(), view_point(x, view)
    wi, t, pdf, L = kernels().light_sample(scene, 0, rows(p, N), random_numbers(N, 2, seed=len(name) + 7 * len(view)))
    assert np.isfinite(pdf).all()
    seen = pdf > 0
    np.testing.assert_allclose(np.linalg.norm(wi[seen], axis=1), 1, atol=2e-6)
    assert (L[seen] == 1).all()

    def density(w: np.ndarray) -> np.ndarray:
        return kernels().light_hit(scene, 0, rows(p, len(w)), w.astype(np.float32))[1]

    if x.type is LightType.DISTANT:
        cells = SphereCells(x.world_from_light[:3, 2], spread=min(np.radians(x.angle_deg) * 0.53, np.pi), rings=16, points=32)
        assert density_p_value(cells, density, wi[seen], N) > SIGNIFICANCE
    else:
        # Cells of the light's own surface, however thin it looks: pdf times the solid angle of each small piece.
        # A cylinder's density does not fade towards its outline, which must be found well.
        points, points_v = (6, 400) if x.type is LightType.CYLINDER else (16, 16)
        w, solid_angle = seen_patches(x, p, CELLS * points, CELLS * points_v)
        probability = (density(w) * solid_angle).reshape(CELLS, points, CELLS, points_v).sum(axis=(1, 3))
        uv = parameters(x, p + wi[seen].astype(np.float64) * t[seen, None])
        u, v = np.clip(uv, 0, 1).T
        observed = np.histogram2d(u, v, bins=[CELLS, CELLS], range=((0, 1), (0, 1)))[0]
        assert count_p_value(probability.ravel(), observed.ravel(), N) > SIGNIFICANCE
    # The ray that was sampled meets the light, there and with that density, but so near its edge that rounding decides.
    hit_t, hit_pdf = kernels().light_hit(scene, 0, rows(p, int(seen.sum())), wi[seen])
    met = hit_pdf > 0
    assert met.mean() > 0.995
    relative = np.abs(hit_pdf / pdf[seen] - 1)[met]
    assert np.quantile(relative, 0.99) < 2e-3
    if x.type is not LightType.DISTANT:
        assert np.quantile(np.abs(hit_t / t[seen] - 1)[met], 0.99) < 1e-3


@pytest.mark.parametrize(("name", "view"), [(n, v) for n, v in CASES if LIGHTS[n].type is not LightType.DISTANT])
def test_solid_angle(name: str, view: str) -> None:
    """The mean of 1 / pdf over samples is the solid angle of the emitting surface."""
    x = LIGHTS[name]
    p = view_point(x, view)
    expected = seen_patches(x, p, 400)[1].sum()
    pdf = kernels().light_sample(only(x).build(), 0, rows(p, N), random_numbers(N, 2, seed=9))[2].astype(np.float64)
    inverse = np.where(pdf > 0, 1 / np.maximum(pdf, 1e-30), 0)
    # Five standard errors (one in a million), and the quadrature's own error.
    assert inverse.mean() == pytest.approx(expected, abs=5 * inverse.std() / np.sqrt(N) + 2e-3 * expected)


ROUND = {
    "disk": (light(LightType.DISK, PLACED, radius=0.5), 0.001),
    "cylinder": (light(LightType.CYLINDER, PLACED, radius=0.2, length=1.4), 0.2),
    "long cylinder": (light(LightType.CYLINDER, PLACED, radius=0.02, length=4.0), 0.01),
}


@pytest.mark.parametrize("view", [view for view in VIEWS if view not in ("inside", "behind")])
@pytest.mark.parametrize("name", ROUND)
def test_round_lights_are_sampled_by_solid_angle(name: str, view: str) -> None:
    """The density is nearly even, near and far: the relative variance of its inverse, which by area, or with directions that
    miss, is 0.2 and more from near."""
    x, most = ROUND[name]
    p = rows(view_point(x, view), N)
    pdf = kernels().light_sample(only(x).build(), 0, p, random_numbers(N, 2, seed=4))[2]
    inverse = 1 / np.maximum(pdf.astype(np.float64), 1e-30) * (pdf > 0)
    assert (pdf > 0).mean() > 0.999
    assert inverse.var() < most * inverse.mean() ** 2


def test_not_seen_from_inside_or_behind() -> None:
    for name, x in LIGHTS.items():
        for view in ("inside", "behind"):
            if is_seen(x, view) or x.type is LightType.DISTANT:
                continue
            scene, p = only(x).build(), view_point(x, view)
            u = random_numbers(512, 2, seed=1)
            assert (kernels().light_sample(scene, 0, rows(p, 512), u)[2] == 0).all(), (name, view)
            w = np.random.default_rng(1).normal(size=(512, 3))
            w = (w / np.linalg.norm(w, axis=1)[:, None]).astype(np.float32)
            assert (kernels().light_hit(scene, 0, rows(p, 512), w)[1] == 0).all(), (name, view)


@pytest.mark.parametrize("name", LIGHTS)
def test_lanes_do_not_change_bits(name: str) -> None:
    x = LIGHTS[name]
    p = np.random.default_rng(4).normal(size=(999, 3)) * 2
    u = random_numbers(999, 2, seed=4)
    scene = only(x).build()
    seen = kernels().light_sample(scene, 0, p, u)[2] > 0
    for one, many in zip(kernels().light_sample(scene, 0, p, u, 1), kernels().light_sample(scene, 0, p, u), strict=True):
        assert np.array_equal(one[seen], many[seen])


TEXTURES = {
    "bright texel": np.pad(np.full((1, 1, 3), 1e4, np.float32), ((9, 22), (40, 23), (0, 0)), constant_values=0.1),
    "gradient": np.linspace(0.1, 5, 32 * 16 * 3, dtype=np.float32).reshape(16, 32, 3) ** 12,
    "one row": np.pad(np.array([[[1, 2, 3], [400, 0, 100], [0, 0, 0], [9, 1, 2]]], np.float32), ((0, 0), (20, 8), (0, 0))),
    "pole": np.pad(np.full((1, 16, 3), 50.0, np.float32), ((0, 15), (0, 0), (0, 0)), constant_values=1.0),
}


@pytest.mark.parametrize("name", TEXTURES)
@pytest.mark.parametrize("diffuse", [1.0, 0.5])
def test_dome_samples_follow_the_density(name: str, diffuse: float) -> None:
    """diffuse other than 1: all of the image is sampled, else what exceeds its mean."""
    dome = light(LightType.DOME, rotation([1, 2, 3], 50), diffuse=diffuse)
    scene = only(dome, TEXTURES[name]).build()
    wi, t, pdf, L = kernels().light_sample(scene, 0, np.zeros((N, 3)), random_numbers(N, 2, seed=3))
    assert np.isinf(t).all()
    density, radiance = kernels().dome_eval(scene, 0, wi)
    # Between two texels rounding may decide.
    assert np.mean(np.abs(density / pdf - 1) < 1e-5) > 0.99
    assert np.mean(np.abs(radiance - L).max(axis=1) < 1e-3 * L.max()) > 0.99
    # Cells are quarters of texels, in which the density is constant.
    local = wi.astype(np.float64) @ dome.world_from_light[:3, :3]
    height, width = (2 * n for n in TEXTURES[name].shape[:2])
    column = ((0.5 - np.arctan2(local[:, 0], local[:, 2]) / (2 * np.pi)) * width).astype(int) % width
    row = np.minimum((np.arccos(local[:, 1]) / np.pi * height).astype(int), height - 1)
    observed = np.bincount(row * width + column, minlength=width * height)
    theta = np.pi * (np.arange(height) + 0.5) / height
    a = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)
    centers = np.stack(
        [np.outer(np.sin(theta), np.sin(a)), np.outer(np.cos(theta), np.ones(width)), np.outer(np.sin(theta), np.cos(a))],
        axis=-1,
    ).reshape(-1, 3)
    probability = (
        kernels().dome_eval(scene, 0, (centers @ dome.world_from_light[:3, :3].T).astype(np.float32))[0].astype(np.float64)
    )
    probability *= np.repeat(-np.diff(np.cos(np.pi * np.arange(height + 1) / height)) * 2 * np.pi / width, width)
    assert probability.sum() == pytest.approx(1, abs=1e-4)
    assert count_p_value(probability, observed.astype(np.float64), N) > SIGNIFICANCE


def test_soft_skies_are_not_sampled() -> None:
    """Rays by the cosine find them better; a spot, a bright third of the sky or a shadow of its own needs samples."""
    elevation = np.cos(np.pi * (np.arange(64) + 0.5) / 64)[:, None, None]
    soft = np.broadcast_to(0.6 + 0.4 * elevation, (64, 128, 3)).astype(np.float32)
    spot = soft.copy()
    spot[20, 30] = 2e3
    beam = soft * np.where(elevation > 0.95, 50, 1).astype(np.float32)
    dome = light(LightType.DOME, rotation([1, 2, 3], 50))
    for image, sampled in ((soft, 0), (spot, 1), (beam, 1)):
        assert only(dome, image).build().sampled_lights == sampled
    fading = replace(dome, shadow=Shadow(distance=4.0))
    assert only(fading, soft).build().sampled_lights == 1


def test_dome_orientation_and_interpolation() -> None:
    """UsdLux, DomeLight: pole +Y, centre +Z, s = 0.5 - atan2(x, z) / 2 pi, t from the top acos(y) / pi; bilinear."""
    m = rotation([1, -2, 0.5], 130)
    image = np.random.default_rng(5).random((8, 16, 3)).astype(np.float32)
    scene = only(light(LightType.DOME, m, (2.0, 0.5, 1.0)), image).build()
    w = np.random.default_rng(6).normal(size=(4000, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    x, y, z = (w @ m[:3, :3]).T
    s, t = (0.5 - np.arctan2(x, z) / (2 * np.pi)) * 16 - 0.5, np.arccos(y) / np.pi * 8 - 0.5
    i, j = np.floor(s).astype(int), np.floor(t).astype(int)
    fs, ft = (s - i)[:, None], (t - j)[:, None]

    def texel(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return image[np.clip(row, 0, 7), column % 16].astype(float)

    top = texel(j, i) * (1 - fs) + texel(j, i + 1) * fs
    bottom = texel(j + 1, i) * (1 - fs) + texel(j + 1, i + 1) * fs
    expected = (top * (1 - ft) + bottom * ft) * [2.0, 0.5, 1.0]
    np.testing.assert_allclose(kernels().dome_eval(scene, 0, w.astype(np.float32))[1], expected, atol=5e-5)


def test_points_and_delta_suns() -> None:
    lights = [light(LightType.POINT, translation(1, 2, 3), (3.0, 2.0, 1.0)), light(LightType.DISTANT, PLACED, (5.0, 6.0, 7.0))]
    scene = describe(lights=lights).build()
    p = np.array([[0.0, 0.5, -1.0]])
    u = random_numbers(1, 2, seed=0)
    wi, t, pdf, L = kernels().light_sample(scene, 0, p, u)
    to = np.array([1, 1.5, 4.0])
    np.testing.assert_allclose(wi[0], to / np.linalg.norm(to), atol=1e-6)
    np.testing.assert_allclose(t, np.linalg.norm(to), rtol=1e-6)
    np.testing.assert_allclose(L[0] / pdf[0], np.array([3, 2, 1]) / (to @ to), rtol=1e-5)
    wi, t, pdf, L = kernels().light_sample(scene, 1, p, u)
    np.testing.assert_allclose(wi[0], PLACED[:3, 2], atol=1e-6)
    np.testing.assert_allclose(L[0] / pdf[0], [5, 6, 7], rtol=1e-6)
    assert np.isinf(t[0])


@pytest.mark.parametrize("count", [2, 3, 4, 7, 17, 30])
def test_choice_of_lights(count: int) -> None:
    rng = np.random.default_rng(count)
    chosen = list(LIGHTS.values())
    lights = []
    for i in range(count):
        x = chosen[i % len(chosen)]
        m = translation(*rng.normal(size=3) * 3) @ rotation(rng.normal(size=3), 360 * rng.random()) @ x.world_from_light
        lights.append(light(x.type, m, float(rng.uniform(0.1, 9)), radius=x.radius, width=x.width, angle_deg=x.angle_deg))
    scene = describe(lights=lights).build()
    points = rng.normal(size=(50, 3)) * 4
    around = np.zeros((50, 3), np.float32)
    probability = kernels().light_probabilities(scene, points, around).astype(np.float64)
    np.testing.assert_allclose(probability.sum(axis=1), 1, atol=1e-5)
    n = 20_000
    for k in range(0, 50, 10):
        u = random_numbers(n, 1, seed=k).ravel()
        light_number, p = kernels().choose_light(scene, rows(points[k], n), np.zeros((n, 3), np.float32), u)
        np.testing.assert_allclose(p, probability[k][light_number], rtol=1e-4, atol=1e-7)
        share = np.bincount(light_number, minlength=count) / n
        # Five standard errors.
        assert (np.abs(share - probability[k]) <= 5 * np.sqrt(probability[k] * (1 - probability[k]) / n) + 1e-4).all()
    # A light that can reach a point is never left out there.
    for i, x in enumerate(lights):
        pdf = kernels().light_sample(scene, i, points, np.full((50, 2), 0.5, np.float32))[2]
        assert (probability[:, i][pdf > 0] > 0).all(), x


@pytest.mark.parametrize("kind", [LightType.SPHERE, LightType.DISK, LightType.RECT, LightType.CYLINDER])
@pytest.mark.parametrize("size", [0.01, 1.0, 100.0])
def test_sheared_lights_are_weighed_as_others_are(kind: LightType, size: float) -> None:
    """In scenes of any size, which is not that of the light's own units."""
    ground = mesh(np.array([[-64.0, -9, 64], [64, -9, 64], [0, -9, -64]]) * size, [[0, 1, 2]])
    sizes = {"radius": 0.5 * size, "width": size, "height": size, "length": size}
    shear = np.eye(4)
    shear[0, 1] = 1e-3
    both = [
        light(kind, translation(*(np.array([x, 9, 0]) * size)) @ rotation([1, 0, 0], -90) @ m, **sizes)
        for x, m in ((-2, np.eye(4)), (2, shear))
    ]
    scene = describe([(ground, np.eye(4))], [lambert(0.5)], both).build()
    probability = kernels().light_probabilities(scene, np.array([[0.0, -1, 0]]) * size, np.zeros((1, 3), np.float32))
    np.testing.assert_allclose(probability[0], 0.5, atol=0.01)
