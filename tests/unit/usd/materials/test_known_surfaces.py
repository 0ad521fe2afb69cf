"""Surfaces of MaterialX's models, as what can be rendered, and what is told of the rest."""

from __future__ import annotations

from typing import Any

import pytest
from tests.unit.usd.material_text import material, surface_of

STANDARD = "ND_standard_surface_surfaceshader"
OPEN_PBR = "ND_open_pbr_surface_surfaceshader"
GLTF = "ND_gltf_pbr_surfaceshader"
DISNEY = "ND_disney_principled"


def close(values: float | tuple[float, ...]) -> object:
    return pytest.approx(values, rel=1e-6, abs=1e-9)


CASES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "standard_surface": (STANDARD, "", {"diffuse_color": (0.8, 0.8, 0.8), "metallic": 0.0, "roughness": 0.2, "ior": 1.5}),
    "open_pbr": (OPEN_PBR, "", {"diffuse_color": (0.8, 0.8, 0.8), "roughness": 0.3, "ior": 1.5, "opacity": 1.0}),
    "gltf": (GLTF, "", {"diffuse_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": 1.0}),
    "disney": (DISNEY, "", {"diffuse_color": (0.16, 0.16, 0.16), "roughness": 0.5, "ior": 1.5, "clearcoat": 0.0}),
    "a base's weight": (
        STANDARD,
        "float inputs:base = 0.5\n color3f inputs:base_color = (1, 0.5, 0)",
        {"diffuse_color": (0.5, 0.25, 0.0)},
    ),
    "emission": (
        STANDARD,
        "float inputs:emission = 4\n color3f inputs:emission_color = (1, 0.5, 0)",
        {"emissive_color": (4.0, 2.0, 0.0)},
    ),
    "luminance": (
        OPEN_PBR,
        "float inputs:emission_luminance = 100\n color3f inputs:emission_color = (1, 0.5, 0)",
        {"emissive_color": (100.0, 50.0, 0.0)},
    ),
    "a coat": (
        STANDARD,
        "float inputs:coat = 1\n float inputs:coat_roughness = 0.25",
        {"clearcoat": 1.0, "clearcoat_roughness": 0.25},
    ),
    "no specular": (STANDARD, "float inputs:specular = 0", {"ior": 1.0}),
    "half specular": (OPEN_PBR, "float inputs:specular_weight = 0.25", {"ior": 1.1 / 0.9}),  # sqrt(0.25 * 0.04) = 0.1
    "glass": (
        STANDARD,
        "float inputs:transmission = 0.75\n float inputs:specular_IOR = 1.4",
        {"opacity": 0.25, "presence": False},
    ),
    "glass of metal": (STANDARD, "float inputs:transmission = 1\n float inputs:metalness = 1", {"opacity": 1.0}),
    "opacity": (STANDARD, "color3f inputs:opacity = (0.25, 0.25, 0.25)", {"opacity": 0.25, "presence": True}),
    "opacity of open_pbr": (OPEN_PBR, "float inputs:geometry_opacity = 0.25", {"opacity": 0.25, "presence": True}),
    "opaque": (GLTF, "float inputs:alpha = 0.25", {"opacity": 1.0, "presence": False}),
    "blended": (GLTF, "float inputs:alpha = 0.25\n int inputs:alpha_mode = 2", {"opacity": 0.25, "presence": True}),
    "masked": (GLTF, "float inputs:alpha = 0.75\n int inputs:alpha_mode = 1", {"opacity": 1.0, "presence": False}),
    "gloss": (DISNEY, "float inputs:clearcoat = 1\n float inputs:clearcoatGloss = 0.75", {"clearcoat_roughness": 0.25}),
    "unlit": (
        "ND_surface_unlit",
        "float inputs:emission = 2\n color3f inputs:emission_color = (1, 0.5, 0)",
        {"emissive_color": (2.0, 1.0, 0.0), "diffuse_color": (0.0, 0.0, 0.0), "ior": 1.0},
    ),
    "beyond their range": (STANDARD, "float inputs:base = 3\n float inputs:specular_roughness = -1",
                           {"diffuse_color": (1.0, 1.0, 1.0), "roughness": 0.0}),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_inputs_become_the_surfaces(case: str) -> None:
    shader, inputs, expected = CASES[case]
    surface, told = surface_of(material(inputs, shader=shader))
    assert {name: getattr(surface, name) for name in expected} == {name: close(value) for name, value in expected.items()}
    assert told == []


UNUSED = {
    "float inputs:sheen = 1": "sheen",
    "float inputs:subsurface = 0.5": "subsurface",
    "float inputs:transmission = 1\n color3f inputs:transmission_color = (1, 0, 0)": "transmission_color",
    "float inputs:coat = 1\n color3f inputs:coat_color = (1, 0, 0)": "coat_color",
}


@pytest.mark.parametrize("inputs", UNUSED)
def test_what_has_no_effect_is_told_once(inputs: str) -> None:
    _, told = surface_of(material(inputs, shader=STANDARD))
    assert told == [("material-input", "/m/s")]


def test_what_is_out_of_effect_is_not_told() -> None:
    text = "color3f inputs:coat_color = (1, 0, 0)\n float inputs:transmission_depth = 3\n float inputs:sheen_roughness = 0.7"
    assert surface_of(material(text, shader=STANDARD))[1] == []


def test_thin_walls_let_light_straight_through() -> None:
    glass = "float inputs:transmission = 1\n bool inputs:thin_walled = 1"
    assert surface_of(material(glass, shader=STANDARD))[0].thin
    assert not surface_of(material("float inputs:transmission = 1", shader=STANDARD))[0].thin


def test_materialx_comes_before_the_universal_output() -> None:
    both = "token outputs:mtlx:surface.connect = </m/x.outputs:out>"
    said = f'uniform token info:id = "{OPEN_PBR}"\n float inputs:specular_roughness = 0.75'
    other = f'def Shader "x" {{\n {said}\n token outputs:out\n}}'
    assert surface_of(material("float inputs:roughness = 0.25", other, both))[0].roughness == 0.75
    unknown = other.replace(OPEN_PBR, "ND_surface")
    assert surface_of(material("float inputs:roughness = 0.25", unknown, both))[0].roughness == 0.25
