"""Materials of MDL's stock modules."""

from __future__ import annotations

from typing import Any

import pytest
from tests.unit.usd.material_text import surface_of

from primray.description import TextureInput

STAGE = """
def Material "m"
{
    token outputs:mdl:surface.connect = </m/s.outputs:out>
    def Shader "s"
    {
        uniform token info:implementationSource = "sourceAsset"
        uniform asset info:mdl:sourceAsset = @MODULE@
        uniform token info:mdl:sourceAsset:subIdentifier = "NAME"
        INPUTS
        token outputs:out
    }
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
}
"""


def stage(module: str, inputs: str) -> str:
    return STAGE.replace("MODULE", module).replace("INPUTS", inputs)


CASES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "OmniPBR's defaults": (
        "OmniPBR.mdl",
        "",
        {"diffuse_color": (0.2, 0.2, 0.2), "roughness": 0.5, "metallic": 0.0, "ior": 1.5},
    ),
    "OmniPBR": (
        "OmniPBR.mdl",
        "color3f inputs:diffuse_color_constant = (1, 0.5, 0)\n color3f inputs:diffuse_tint = (0.5, 0.5, 0.5)\n"
        "float inputs:reflection_roughness_constant = 0.25\n float inputs:metallic_constant = 1",
        {"diffuse_color": (0.5, 0.25, 0.0), "roughness": 0.25, "metallic": 1.0},
    ),
    "OmniPBR that shines": (
        "OmniPBR.mdl",
        "bool inputs:enable_emission = 1\n color3f inputs:emissive_color = (1, 0.5, 0)\n float inputs:emissive_intensity = 100",
        {"emissive_color": (100.0, 50.0, 0.0)},
    ),
    "OmniPBR_Opacity": (
        "OmniPBR_Opacity.mdl",
        "bool inputs:enable_opacity = 1\n float inputs:opacity_constant = 0.25",
        {"opacity": 0.25, "presence": True},
    ),
    "OmniGlass": ("OmniGlass.mdl", "float inputs:glass_ior = 1.4", {"opacity": 0.0, "ior": 1.4, "roughness": 0.0}),
    "OmniSurface": (
        "https://host/Materials/OmniSurface.mdl",
        "color3f inputs:diffuse_reflection_color = (1, 0.5, 0)\n float inputs:metalness = 0.5\n float inputs:coat_weight = 1",
        {"diffuse_color": (0.8, 0.4, 0.0), "metallic": 0.5, "clearcoat": 1.0},
    ),
    "UsdPreviewSurface": (
        "UsdPreviewSurface.mdl",
        "color3f inputs:diffuseColor = (1, 0.5, 0)",
        {"diffuse_color": (1.0, 0.5, 0.0)},
    ),
    "gltf": (
        "gltf/pbr.mdl",
        "color3f inputs:base_color_factor = (1, 0.5, 0)\n float inputs:roughness_factor = 0.25",
        {"diffuse_color": (1.0, 0.5, 0.0), "roughness": 0.25, "metallic": 1.0},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_documented_inputs_are_translated_and_told(case: str) -> None:
    module, inputs, expected = CASES[case]
    surface, told = surface_of(stage(module, inputs))
    assert {name: getattr(surface, name) for name in expected} == {n: pytest.approx(v) for n, v in expected.items()}
    assert told == [("mdl-material", "/m/s")]


def test_textures_are_where_the_material_says(image: str) -> None:
    text = f"asset inputs:diffuse_texture = @{image}@\n float2 inputs:texture_scale = (2, 3)\n"
    text += "float inputs:albedo_brightness = 0.5"
    surface, _ = surface_of(stage("OmniPBR.mdl", text))
    made = dict(surface.inputs)["diffuse_color"]
    assert isinstance(made, TextureInput)
    assert made.st_transform == (2, 0, 0, 0, 3, 0)
    assert made.scale[:3] == (0.5, 0.5, 0.5)


def test_packed_maps_have_their_channels(image: str) -> None:
    text = (
        f"bool inputs:enable_ORM_texture = 1\n asset inputs:ORM_texture = @{image}@\n"
        "float inputs:metallic_texture_influence = 1\n float inputs:reflection_roughness_texture_influence = 1"
    )
    surface, _ = surface_of(stage("OmniPBR.mdl", text))
    found = {name: made.channels for name, made in surface.inputs if isinstance(made, TextureInput)}
    assert found == {"roughness": "g", "metallic": "b"}


def test_other_modules_leave_the_display_color() -> None:
    surface, told = surface_of(stage("my/own.mdl", ""))
    assert surface.path == ""
    assert told == [("shader-ignored", "/m")]
