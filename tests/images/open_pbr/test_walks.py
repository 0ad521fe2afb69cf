"""Random walks below opaque surfaces against half-spaces and slabs in closed form, from albedo 0.3 to 0.999."""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt
import pytest

from .test_interiors import SKY, Inputs, ball, box, material, seen

Doubles = npt.NDArray[np.float64]
SUN = """def DistantLight "sun" {{ float inputs:angle = 0.1
    float inputs:intensity = 1
    bool inputs:normalize = 1
    float3 xformOp:rotateXYZ = ({}, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}}
"""
ABOVE, BELOW, COSINE = SUN.format(-60), SUN.format(-120), 0.5


def albedo_of(color: float) -> float:
    """The single-scattering albedo that the surface takes for a colour (van de Hulst's formula, inverted)."""
    s = 4.09712 + 4.20863 * color - math.sqrt(9.59217 + 41.6808 * color + 17.7126 * color * color)
    return 1 - s * s


def color_of(albedo: float) -> float:
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if albedo_of(middle) < albedo else (low, middle)
    return low


def wax(*albedos: float, radius: float = 1.0, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> str:
    inputs: Inputs = {"specular_weight": 0.0, "subsurface_weight": 1.0, "subsurface_radius": radius}
    colors = tuple(color_of(a) for a in albedos)
    return material("m", {**inputs, "subsurface_color": colors, "subsurface_radius_scale": scale})


def expn(n: int, x: Doubles) -> Doubles:
    """The exponential integral E_n for n > 1, by Gauss points in t = mu^4, where its end at 0 is smooth."""
    t, w = np.polynomial.legendre.leggauss(256)
    t, w = (t + 1) / 2, w / 2
    mu = t**4
    with np.errstate(under="ignore"):
        return np.asarray((4 * t**3 * w * mu ** (n - 2) * np.exp(-x[..., None] / mu)).sum(-1))


@functools.cache
def slab(albedo: float, depth: float, cells: int = 600) -> tuple[float, float]:
    """Reflectance and transmittance of diffuse light by a slab that scatters isotropically: piecewise constant collisions."""
    edges = depth / 2 * (1 - np.cos(np.pi * np.arange(cells + 1) / cells))  # finer at both surfaces
    centres, widths = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    e2 = expn(2, np.abs(centres[:, None] - edges[None, :]))
    inside = np.eye(cells) * 2
    # The integral of E1(|z - t|) over a cell is a difference of E2, or 2 less both where the cell holds z.
    kernel = np.where(np.eye(cells) > 0, inside - e2[:, 1:] - e2[:, :-1], np.abs(np.diff(e2, axis=1)))
    first = 2 * -np.diff(expn(3, edges)) / widths  # density of first collisions
    found = np.linalg.solve(np.eye(cells) - albedo / 2 * kernel, first)
    leaves = -np.diff(expn(3, edges))
    reflected = albedo / 2 * (found * leaves).sum()
    passed = albedo / 2 * (found * leaves[::-1]).sum() + 2 * float(expn(3, np.array(depth)))
    return float(reflected), float(passed)


def half_space(albedo: float) -> float:
    """Reflectance of diffuse light, by the moment of Chandrasekhar's H function of isotropic scattering."""
    x, w = np.polynomial.legendre.leggauss(400)
    mu, w = ((x + 1) / 2) ** 2, w * (x + 1) / 2
    h = np.ones(len(x))
    for _ in range(2000):
        h = 1 / (math.sqrt(1 - albedo) + albedo / 2 * (w * mu * h / (mu[:, None] + mu)).sum(1))
    return float(1 - 2 * math.sqrt(1 - albedo) * (w * h * mu).sum())


def test_the_closed_forms_agree() -> None:
    for albedo in (0.5, 0.9):
        assert slab(albedo, 30.0)[0] == pytest.approx(half_space(albedo), rel=1e-3)
    assert sum(slab(1.0, 5.0)) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("albedos", [(0.3, 0.6, 0.8), (0.9, 0.95, 0.98), (0.99, 0.995, 0.999)])
def test_half_spaces_reflect_a_white_sky(albedos: tuple[float, float, float]) -> None:
    found = seen(box((40000, 40000, 3000), z=-1500), wax(*albedos), SKY, spp=4096)
    np.testing.assert_allclose(found, [half_space(a) for a in albedos], rtol=3e-3)


def test_half_spaces_of_three_paths_reflect_alike() -> None:
    """What a half-space reflects does not depend on its unit of length, but a guide of three channels must know them."""
    albedos = (0.99, 0.93, 0.88)
    found = seen(box((40000, 40000, 3000), z=-1500), wax(*albedos, scale=(1.0, 0.4, 0.2)), SKY, spp=4096)
    np.testing.assert_allclose(found, [half_space(a) for a in albedos], rtol=4e-3)


@pytest.mark.parametrize("depth", [0.3, 1.0, 5.0])
def test_slabs_reflect_and_pass_the_sun(depth: float) -> None:
    albedos = (0.6, 0.9, 0.99)
    sheet = box((4000, 4000, depth))
    for sun, side in ((ABOVE, 0), (BELOW, 1)):
        found = seen(sheet, wax(*albedos), sun, spp=4096)
        expected = [slab(a, depth)[side] * COSINE / math.pi for a in albedos]
        np.testing.assert_allclose(found, expected, rtol=1.5e-2)


@pytest.mark.parametrize("radius", [3.0, 0.3, 0.03])
def test_white_bodies_are_as_white_as_the_sky(radius: float) -> None:
    np.testing.assert_allclose(seen(ball(5.0), wax(1.0, 1.0, 1.0, radius=radius), SKY, spp=256), 1.0, atol=3e-3)
