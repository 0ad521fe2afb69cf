"""A denoiser's guides through mirrors and clear glass, against closed forms; whatever scatters widely is where they end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.images.aovs.seen import stage_of

import primray
from primray.images.image import Image

WALL = (0.6, 0.3, 0.2)
SILVER = (0.9, 0.8, 0.7)

MATERIAL = """
def Material "shiny"
{
    token outputs:surface.connect = </shiny/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        INPUTS
        token outputs:surface
    }
}
"""


def _mesh(name: str, points: str, more: str = "") -> str:
    return f"""
def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [{points}]
    uniform token subdivisionScheme = "none"
    {more}
}}
"""


COLOR = f"color3f[] primvars:displayColor = [{WALL}]"
# The camera looks along -Z from z = 6 at a mirror that turns its view to -X, where a wall fills it.
MIRROR = _mesh("mirror", "(-8, -8, -8), (8, -8, 8), (8, 8, 8), (-8, 8, -8)", "rel material:binding = </shiny>")
ASIDE = _mesh("wall", "(-9, -99, -99), (-9, -99, 99), (-9, 99, 99), (-9, 99, -99)", COLOR)
SLAB = """
def Cube "slab" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    double size = 2
    float3 xformOp:scale = (40, 40, 0.1)
    uniform token[] xformOpOrder = ["xformOp:scale"]
    rel material:binding = </shiny>
}
"""
BEHIND = _mesh("wall", "(-99, -99, -9), (99, -99, -9), (99, 99, -9), (-99, 99, -9)", COLOR)


def _seen(text: str, inputs: str, **values: Any) -> Image:
    stage = stage_of(text + MATERIAL.replace("INPUTS", inputs))
    aovs = ["guide_albedo", "guide_normal", "albedo"]
    return primray.render(stage, resolution=(24, 18), spp=2, aovs=aovs, progress=False, **values)


CLEAR = "float inputs:opacity = 0\nfloat inputs:roughness = 0\nfloat inputs:ior = 1.5"
METAL = f"color3f inputs:diffuseColor = {SILVER}\nfloat inputs:metallic = 1\nfloat inputs:roughness = "


def test_a_mirror_shows_what_it_reflects() -> None:
    image = _seen(MIRROR + ASIDE, METAL + "0")
    expected = np.array(SILVER) * np.array(WALL)
    np.testing.assert_allclose(image.aovs["guide_albedo"].values, np.broadcast_to(expected, (18, 24, 3)), rtol=2e-5)
    np.testing.assert_allclose(image.aovs["guide_normal"].values, np.broadcast_to((1, 0, 0), (18, 24, 3)), atol=2e-6)
    # The reflectance of what is seen stays the mirror's own.
    np.testing.assert_allclose(image.aovs["albedo"].values, np.broadcast_to(SILVER, (18, 24, 3)), rtol=1e-6)


def test_a_rough_one_is_what_is_seen() -> None:
    image = _seen(MIRROR + ASIDE, METAL + "0.3")
    np.testing.assert_array_equal(image.aovs["guide_albedo"].values, image.aovs["albedo"].values)


def test_mirrors_that_face_each_other_end() -> None:
    other = _mesh("other", "(-4, -4, 2.5), (-4, 4, 2.5), (4, 4, 2.5), (4, -4, 2.5)", "rel material:binding = </shiny>")
    facing = _mesh("mirror", "(-4, -4, -4), (4, -4, -4), (4, 4, -4), (-4, 4, -4)", "rel material:binding = </shiny>")
    image = _seen(facing + other.replace("2.5", "7"), METAL + "0")
    albedo = image.aovs["guide_albedo"].values
    assert np.isfinite(albedo).all()
    assert (albedo <= np.array(SILVER) + 1e-6).all()
    assert albedo[9, 12].max() > 0


@pytest.mark.parametrize("lanes", [None, "1"])
def test_glass_shows_what_is_behind_it(lanes: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """By normal incidence a slab reflects little, and all that is seen is what passes."""
    if lanes is not None:
        monkeypatch.setenv("PRIMRAY_LANES", lanes)
    image = _seen(SLAB + BEHIND, CLEAR)
    np.testing.assert_allclose(image.aovs["guide_albedo"].values, np.broadcast_to(WALL, (18, 24, 3)), rtol=1e-5)
    np.testing.assert_allclose(image.aovs["guide_normal"].values, np.broadcast_to((0, 0, 1), (18, 24, 3)), atol=1e-6)


def test_thin_glass_does_not_bend() -> None:
    """What is seen through it stands where it is."""
    pane = _mesh("pane", "(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)", "rel material:binding = </shiny>")
    half = _mesh("wall", "(0, -99, -9), (99, -99, -9), (99, 99, -9), (0, 99, -9)", COLOR)
    image = _seen(pane + half, "float inputs:opacity = 0\nfloat inputs:roughness = 0.4\nfloat inputs:ior = 1.5")
    albedo = image.aovs["guide_albedo"].values
    assert (albedo[:, 13:].mean(axis=(0, 1)) > 0.8 * np.array(WALL)).all()
    assert albedo[:, :11].max() < 0.06  # the pane's own sheen
