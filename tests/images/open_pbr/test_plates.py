"""OpenPBR materials in closed form, from a stage's MaterialX nodes to pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from .plates import SKY, image, seen, stage

COLOR = (0.8, 0.5, 0.2)
PLAIN = {"specular_weight": 0.0, "base_color": COLOR}
GLASS = {"transmission_weight": 1.0, "specular_roughness": 0.0}


# A wide light behind the plate, seen through it.
WALL = """
def RectLight "wall"
{
    float inputs:width = 1800
    float inputs:height = 1800
    double3 xformOp:translate = (0, 0, -40)
    float3 xformOp:rotateXYZ = (0, 180, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""


def fresnel(cosine: float, eta: float) -> float:
    t = math.sqrt(1 - (1 - cosine**2) / eta**2)
    s, p = (cosine - eta * t) / (cosine + eta * t), (eta * cosine - t) / (eta * cosine + t)
    return (s * s + p * p) / 2


@pytest.mark.parametrize("tilt", [0.0, 50.0])
def test_without_specular_a_base_is_lambert(tilt: float) -> None:
    np.testing.assert_allclose(seen(stage(PLAIN, tilt=tilt)), COLOR, rtol=1e-3)
    half = {**PLAIN, "base_weight": 0.5}
    np.testing.assert_allclose(seen(stage(half, tilt=tilt)), np.multiply(COLOR, 0.5), rtol=1e-3)


def test_a_smooth_base_reflects_fresnels_part_of_a_white_sky_and_its_colour_of_the_rest() -> None:
    for tilt in (0.0, 60.0):
        f = fresnel(math.cos(math.radians(tilt)), 1.5)
        found = seen(stage({"base_color": COLOR, "specular_roughness": 0.0}, tilt=tilt), spp=1024)
        np.testing.assert_allclose(found, f + (1 - f) * np.array(COLOR), rtol=5e-3)


def test_metals_go_from_their_colour_to_their_tinted_edge() -> None:
    metal = {"base_metalness": 1.0, "base_color": COLOR, "specular_color": (0.5, 0.9, 1.0), "specular_roughness": 0.0}
    np.testing.assert_allclose(seen(stage(metal)), COLOR, rtol=1e-4)
    tilt = math.degrees(math.acos(1 / 7))
    schlick = np.array(COLOR) + (1 - np.array(COLOR)) * (6 / 7) ** 5
    np.testing.assert_allclose(seen(stage(metal, tilt=tilt)), schlick * (0.5, 0.9, 1.0), rtol=1e-3)


@pytest.mark.parametrize("tilt", [0.0, 50.0])
def test_panes_let_through_and_reflect_their_series(tilt: float) -> None:
    tint = np.array((0.9, 0.7, 0.4))
    pane = {**GLASS, "transmission_color": tuple(tint.tolist()), "geometry_thin_walled": True}
    f = fresnel(math.cos(math.radians(tilt)), 1.5)
    through = (1 - f) ** 2 * tint / (1 - f**2 * tint**2)
    reflected = f * (1 + (1 - f) ** 2 * tint**2 / (1 - f**2 * tint**2))
    np.testing.assert_allclose(seen(stage(pane, tilt=tilt), spp=1024), through + reflected, rtol=5e-3)
    np.testing.assert_allclose(seen(stage(pane, lights=WALL, tilt=tilt), spp=1024), through, rtol=5e-3)


def test_emission_below_a_coat_has_the_root_of_its_colour() -> None:
    shining = {
        "base_weight": 0.0,
        "specular_weight": 0.0,
        "emission_luminance": 3.0,
        "emission_color": (1.0, 0.5, 0.25),
        "coat_weight": 0.5,
        "coat_color": (0.25, 0.64, 1.0),
    }
    expected = 3 * np.array((1.0, 0.5, 0.25)) * (0.5 + 0.5 * np.array((0.5, 0.8, 1.0)))
    np.testing.assert_allclose(seen(stage(shining, lights="")), expected, rtol=1e-5)
    bare = {**shining, "coat_weight": 0.0}
    np.testing.assert_allclose(seen(stage(bare, lights="")), 3 * np.array((1.0, 0.5, 0.25)), rtol=1e-6)


LAMP_BEHIND = """
def DistantLight "lamp"
{{
    float inputs:intensity = {intensity}
    float inputs:angle = 1
    float3 xformOp:rotateXYZ = (0, {turn}, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}}
"""


def test_leaves_are_lit_from_both_sides() -> None:
    """f of the transmission is (1 + g) / 2 of the colour over pi, of the reflection (1 - g) / 2; light sampling finds both."""
    leaf = {
        "specular_weight": 0.0,
        "subsurface_weight": 1.0,
        "subsurface_color": COLOR,
        "subsurface_scatter_anisotropy": 0.4,
        "geometry_thin_walled": True,
    }
    irradiance = 10 * math.pi * math.sin(math.radians(0.5)) ** 2
    for turn, share in ((0.0, 0.3), (180.0, 0.7)):
        found = seen(stage(leaf, lights=LAMP_BEHIND.format(intensity=10, turn=turn)))
        np.testing.assert_allclose(found, np.array(COLOR) * share * irradiance / math.pi, rtol=2e-3)
    np.testing.assert_allclose(seen(stage(leaf)), COLOR, rtol=2e-3)


def test_lamps_are_found_through_frosted_panes() -> None:
    """By light sampling as by chance: a lamp's light is that of a small bright part of a sky."""
    pane = {**GLASS, "specular_roughness": 0.6, "geometry_thin_walled": True}
    lamp = LAMP_BEHIND.replace("angle = 1", "angle = 40").format(intensity=5, turn=180)
    light = image(stage(pane, lights=lamp), spp=1024)
    values = np.asarray(light.pixels[..., 0], float)
    # Through the pane 0.92 of the light goes on; the lobe is wider than the lamp.
    assert 0.2 < values.mean() < 5
    assert values.std() / values.mean() < 0.1


def test_a_coat_takes_what_it_reflects() -> None:
    coated = {**PLAIN, "base_color": (0.0, 0.0, 0.0), "coat_weight": 1.0, "coat_roughness": 0.0}
    for tilt in (0.0, 60.0):
        f = fresnel(math.cos(math.radians(tilt)), 1.6)
        np.testing.assert_allclose(seen(stage(coated, tilt=tilt), spp=1024), [f] * 3, rtol=5e-3)


def test_a_black_coat_leaves_its_reflection_alone() -> None:
    dark = {**PLAIN, "coat_weight": 1.0, "coat_color": (0.0, 0.0, 0.0), "coat_roughness": 0.0}
    np.testing.assert_allclose(seen(stage(dark), spp=1024), [fresnel(1.0, 1.6)] * 3, rtol=1e-2)


def test_coats_darken_what_is_below_by_what_they_send_back() -> None:
    """OpenPBR 1.1.1, eq. "interfaced Lambertian": exact for a smooth coat on a Lambert base."""
    base = 0.5
    coated = {"specular_weight": 0.0, "base_color": (base,) * 3, "coat_weight": 1.0, "coat_roughness": 0.0}
    mu = (np.arange(100_000) + 0.5) / 100_000
    mean = float(np.mean([fresnel(m, 1.6) * 2 * m for m in mu[::50]]))
    k = 1 - (1 - mean) / 1.6**2
    f = fresnel(1.0, 1.6)
    expected = f + base * (1 - f) * (1 - k) / (1 - base * k)
    np.testing.assert_allclose(seen(stage(coated), spp=2048), [expected] * 3, rtol=8e-3)
    undarkened = seen(stage({**coated, "coat_darkening": 0.0}), spp=2048)
    np.testing.assert_allclose(undarkened, [f + base * (1 - f)] * 3, rtol=8e-3)


def test_opacity_is_how_much_of_the_surface_is_there() -> None:
    half = {**PLAIN, "geometry_opacity": 0.25}
    found = image(stage(half), spp=4096)
    np.testing.assert_allclose(np.asarray(found.pixels[..., :3], float).mean((0, 1)), np.array(COLOR) * 0.25 + 0.75, rtol=1e-2)


def spread(inputs: dict[str, Any], **of: Any) -> tuple[float, float]:
    """How wide the highlight of a small lamp above a metal plate is, along x and y."""
    metal = {"base_metalness": 1.0, "base_color": (1.0, 1.0, 1.0), "specular_roughness": 0.15, **inputs}
    lamp = """
def SphereLight "lamp"
{
    float inputs:radius = 0.02
    float inputs:intensity = 1000
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    found = np.asarray(image(stage(metal, lights=lamp), resolution=(64, 64), spp=64).pixels[..., 0], float)
    at = (np.arange(64) + 0.5) / 64 - 0.5
    total = found.sum()
    return math.sqrt((found.sum(0) * at**2).sum() / total), math.sqrt((found.sum(1) * at**2).sum() / total)


def test_brushed_metal_spreads_light_along_its_tangent() -> None:
    across, up = spread({})
    assert across == pytest.approx(up, rel=0.03)
    across, up = spread({"specular_roughness_anisotropy": 0.8})
    assert across > 1.5 * up


def test_nothing_is_brighter_than_its_sky() -> None:
    white = {
        "base_color": (1.0, 1.0, 1.0),
        "coat_weight": 0.5,
        "fuzz_weight": 0.5,
        "thin_film_weight": 0.5,
        "base_metalness": 0.2,
    }
    for tilt in (0.0, 40.0, 75.0):
        np.testing.assert_allclose(seen(stage(white, lights=SKY, tilt=tilt), spp=1024), 1, atol=1.2e-2)
