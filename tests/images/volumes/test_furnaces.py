"""Smoke that absorbs nothing, in a sky of one value: it cannot be seen. And the half space of Chandrasekhar."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.described import (
    describe,
    lambert,
    light,
    look_at,
    orthographic,
    perspective,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.images.volumes.voxels import Array, block, check, medium, picture, voxels

from primray.description import LightType, OpenPbr, Sphere, Surface, VolumeMedium

SKY = light(LightType.DOME)
CAMERA = perspective(look_at((30, 12, 20), (3.5, 3.5, 3.5)), 0.3)


def furnace(media: list[VolumeMedium], spp: int = 4, **more: Any) -> Array:
    values: dict[str, Any] = {"camera": CAMERA, "resolution": (16, 16), "lights": [SKY]} | more
    return picture(describe(media=media, **values), spp)


def cloud() -> Any:
    values = np.random.default_rng(1).random((16, 16, 16)) ** 3
    values[5:9] = 0.0
    return voxels(values, (-4, -4, -4))


@pytest.mark.parametrize("g", [0.0, 0.8, -0.9])
@pytest.mark.parametrize("depth", [0.1, 1.0, 10.0, 100.0])
def test_a_white_furnace(depth: float, g: float) -> None:
    np.testing.assert_allclose(furnace([medium(block(), depth / 8, 1.0, anisotropy=g)]), 1.0, rtol=1e-4)
    np.testing.assert_allclose(furnace([medium(cloud(), depth / 4, 1.0, anisotropy=g)]), 1.0, rtol=1e-4)


@pytest.mark.parametrize("depth", [0.5, 10.0])
def test_colored_extinction(depth: float) -> None:
    """Each path keeps the sum of its channels, and each channel is 1 in the mean."""
    smoke = [medium(cloud(), tuple(depth / 4 * np.array((1.0, 0.5, 0.1))), 1.0, anisotropy=0.3)]
    pixels = furnace(smoke, 512)
    flat = pixels.reshape(-1, 3)
    assert (np.abs(flat.mean(axis=0) - 1) < 4.5 * flat.std(axis=0) / 16 + 1e-5).all()
    assert (flat.std(axis=0) / 16 < 5e-3).all()
    assert flat.mean() == pytest.approx(1, abs=2e-3)


def test_media_that_overlap() -> None:
    smoke = [
        medium(cloud(), 1.0, 1.0, anisotropy=0.7),
        medium(block(), 0.5, 1.0),
        medium(block(0.5), 2.0, 1.0, anisotropy=-0.5, matrices=[translation(2, 1, 0) @ rotation((1, 1, 1), 30)]),
    ]
    np.testing.assert_allclose(furnace(smoke), 1.0, rtol=1e-4)


def test_thousands_of_clouds() -> None:
    rng = np.random.default_rng(3)
    places = [translation(*rng.uniform(-200, 200, 3)) @ rotation(rng.normal(size=3), 360 * rng.random()) for _ in range(10_000)]
    smoke = [medium(cloud(), 0.1, 1.0, anisotropy=0.5, matrices=places)]
    camera = perspective(look_at((600, 20, 20), (0, 0, 0)), 0.2)
    np.testing.assert_allclose(furnace(smoke, 4, camera=camera), 1.0, rtol=1e-4)


def test_white_surfaces_within_smoke() -> None:
    ball = (Sphere("/ball", 3.0, 0), translation(3.5, 3.5, 3.5))
    smoke = [medium(block(), 0.3, 1.0, anisotropy=0.3)]
    np.testing.assert_allclose(furnace(smoke, shapes=[ball], surfaces=[lambert(1.0)]), 1.0, rtol=1e-4)
    mirror = Surface("", diffuse_color=(1, 1, 1), metallic=1.0, roughness=0.0)
    np.testing.assert_allclose(furnace(smoke, shapes=[ball], surfaces=[mirror]), 1.0, rtol=1e-4)


GLASS = {
    "solid": Surface("", opacity=0.0, roughness=0.0),
    "thin": Surface("", opacity=0.0, roughness=0.0, thin=True),
    "body": Surface("", open_pbr=OpenPbr(transmission_weight=1.0, specular_roughness=0.0, base_weight=0.0)),
    "scattering body": Surface(
        "",
        open_pbr=OpenPbr(
            transmission_weight=1.0, specular_roughness=0.0, transmission_depth=4.0, transmission_scatter=(1.0, 1.0, 1.0)
        ),
    ),
}


@pytest.mark.parametrize("name", GLASS)
def test_within_glass(name: str) -> None:
    """A ball of glass with smoke in it, and smoke around; light that leaves is scaled back by the square of the index."""
    ball = (Sphere("/ball", 6.0, 0), translation(3.5, 3.5, 3.5))
    within, around = medium(block(), 0.1, 1.0), medium(block(0.5, 16), 0.1, 1.0, matrices=[translation(-4, -4, -4)])
    for smoke in ([within], [around], [within, around]):
        flat = furnace(smoke, 64, shapes=[ball], surfaces=[GLASS[name]]).reshape(-1, 3)
        assert abs(flat.mean() - 1) < 5 * flat.mean(axis=1).std() / 16 + 1e-4, (flat.mean(), flat.std())
        assert flat.mean(axis=1).std() / 16 < 4e-3


def h_function(albedo: float, nodes: int = 100) -> Any:
    """Return Chandrasekhar's H for isotropic scattering: 1 / H(m) = sqrt(1 - a) + a / 2 int_0^1 x H(x) / (m + x) dx."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = (x + 1) / 2, w / 2
    h = np.ones(nodes)
    for _ in range(5000):
        new = 1 / (math.sqrt(1 - albedo) + albedo / 2 * (w * x * h / (x[:, None] + x)).sum(axis=1))
        done = np.abs(new - h).max() < 1e-12
        h = (new + h) / 2
        if done:
            break
    return lambda m: 1 / (math.sqrt(1 - albedo) + albedo / 2 * (w * x * h / (m + x)).sum())


@pytest.mark.parametrize(("albedo", "mu", "mu0"), [(0.3, 1.0, 1.0), (0.9, 0.5, 0.8), (0.99, 0.2, 0.6)])
def test_a_half_space(albedo: float, mu: float, mu0: float) -> None:
    """I = a E / 4 pi mu0 / (mu + mu0) H(mu) H(mu0), for the irradiance E across the beam."""
    h = h_function(albedo)
    wanted = albedo / (4 * math.pi) * mu0 / (mu + mu0) * h(mu) * h(mu0)
    smoke = medium(block(side=16), 1.0, albedo, matrices=[scaling(1e4, 1e4, 10) @ translation(-8, -8, -16)])
    sun = light(LightType.DISTANT, rotation((0, 1, 0), math.degrees(math.acos(mu0))))
    eye = np.array((0.0, math.sqrt(1 - mu * mu), mu)) * 1000
    camera = orthographic(look_at(eye, (0, 0, 0)), 1.0, clipping_range=(0.0, 1e6))
    scene = describe(media=[smoke], lights=[sun], camera=camera, resolution=(16, 16))
    check(picture(scene, 2048), wanted, 0.005)


def test_the_integral_of_h() -> None:
    """Its integral over [0, 1] is 2 / a (1 - sqrt(1 - a)) (Chandrasekhar 1950, "Radiative Transfer", section 38)."""
    x, w = np.polynomial.legendre.leggauss(60)
    for albedo in (0.3, 0.9, 0.99):
        h = h_function(albedo)
        found = sum(w[i] / 2 * h((x[i] + 1) / 2) for i in range(60))
        assert found == pytest.approx(2 / albedo * (1 - math.sqrt(1 - albedo)), rel=1e-4)


def test_an_albedo_of_one_and_roulette() -> None:
    """Light is kept however often it scatters, with a limit on depth only what the limit says is lost."""
    scene = describe(media=[medium(block(), 2.0, 1.0)], lights=[SKY], camera=CAMERA, resolution=(16, 16)).build()
    found = [replicate_means(render(scene, 16, max_depth=depth)).mean() for depth in (1, 4, 16, 64)]
    assert found == sorted(found)
    assert found[0] < 0.9
    assert found[-1] == pytest.approx(1.0, abs=0.02)
    tinted = furnace([medium(block(), 2.0, 0.999)], 64)
    assert 0.9 < tinted.mean() < 1.0
