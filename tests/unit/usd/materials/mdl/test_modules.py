"""Materials of MDL's stock modules."""

from __future__ import annotations

from typing import Any

import pytest
from tests.unit.usd.known_surface_text import close, described, lobes
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


COAT = {"coat_weight": 1.0, "coat_ior": 1.5, "coat_darkening": 0.0, "coat_roughening": 0.0}
MODULE = "{} is translated by its documented inputs, not interpreted."

# Module, inputs, what differs from OpenPBR's defaults, what the message has at its end.
CASES: dict[str, tuple[str, str, dict[str, Any], str]] = {
    "OmniPBR's defaults": (
        "OmniPBR.mdl",
        "",
        {"base_color": (0.2, 0.2, 0.2), "specular_roughness": 0.5, "specular_ior": 1.5},
        "",
    ),
    "OmniPBR": (
        "OmniPBR.mdl",
        "color3f inputs:diffuse_color_constant = (1, 0.5, 0)\n color3f inputs:diffuse_tint = (0.5, 0.5, 0.5)\n"
        "float inputs:reflection_roughness_constant = 0.25\n float inputs:metallic_constant = 1\n"
        "float inputs:specular_level = 0",
        {"base_color": (0.5, 0.25, 0.0), "specular_roughness": 0.25, "base_metalness": 1.0, "specular_ior": 1.0},
        "",
    ),
    "OmniPBR with a coat": (
        "OmniPBR_ClearCoat.mdl",
        "bool inputs:enable_clearcoat = 1\n float inputs:clearcoat_ior = 1.5\n color3f inputs:clearcoat_tint = (1, 0.5, 0)\n"
        "float inputs:clearcoat_reflection_roughness = 0.25\n float inputs:clearcoat_transparency = 0.5",
        {
            **COAT,
            "coat_color": (1.0, 0.5, 0.0),
            "coat_roughness": 0.25,
            "base_color": (0.2, 0.2, 0.2),
            "specular_roughness": 0.5,
            "specular_ior": 2.25,
        },
        " Approximated: clearcoat_tint. Not supported, or only in part: clearcoat_transparency.",
    ),
    "OmniGlass": (
        "OmniGlass.mdl",
        "float inputs:glass_ior = 1.4\n color3f inputs:glass_color = (1, 0.5, 0)\n float inputs:other = 1",
        {
            "base_color": (1.0, 1.0, 1.0),
            "transmission_weight": 1.0,
            "transmission_color": (1.0, 0.5, 0.0),
            "specular_ior": 1.4,
            "specular_roughness": 0.0,
        },
        " Not supported, or only in part: other.",
    ),
    "OmniSurface": (
        "https://host/Materials/OmniSurface.mdl",
        "color3f inputs:diffuse_reflection_color = (1, 0.5, 0)\n float inputs:coat_weight = 1\n"
        "float inputs:coat_roughness = 0.25\n float inputs:subsurface_weight = 0.5\n"
        "float inputs:specular_retro_reflection_weight = 0.5",
        {
            **COAT,
            "coat_roughness": 0.25,
            "base_weight": 0.8,
            "base_color": (1.0, 0.5, 0.0),
            "specular_roughness": 0.2,
            "specular_ior": 2.25,
            "subsurface_weight": 0.5,
            "subsurface_color": (1.0, 1.0, 1.0),
            "subsurface_radius_scale": (1.0, 1.0, 1.0),
            "fuzz_weight": 0.5,
            "fuzz_roughness": 0.3**0.4,
        },
        " Approximated: specular_retro_reflection_weight.",
    ),
    "OmniSurface with a film": (
        "OmniSurfaceBase.mdl",
        "bool inputs:enable_thin_film = 1\n float inputs:thin_film_ior = 2",
        {
            "base_weight": 0.8,
            "base_color": (1.0, 1.0, 1.0),
            "specular_roughness": 0.2,
            "thin_film_weight": 1.0,
            "thin_film_thickness": 0.4,
            "thin_film_ior": 2.0,
        },
        "",
    ),
    "UsdPreviewSurface": (
        "UsdPreviewSurface.mdl",
        "color3f inputs:diffuseColor = (1, 0.5, 0)\n float inputs:clearcoat = 1",
        {**COAT, "coat_roughness": 0.01, "base_color": (1.0, 0.5, 0.0), "specular_roughness": 0.5, "specular_ior": 2.25},
        "",
    ),
    "gltf": (
        "gltf/pbr.mdl",
        "color3f inputs:base_color_factor = (1, 0.5, 0)\n float inputs:roughness_factor = 0.25\n"
        "float inputs:clearcoat_factor = 1",
        {**COAT, "base_color": (1.0, 0.5, 0.0), "specular_roughness": 0.25, "base_metalness": 1.0, "specular_ior": 2.25},
        "",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_documented_inputs_are_translated_and_told(case: str) -> None:
    module, inputs, expected, ending = CASES[case]
    surface, told = described(stage(module, inputs))
    assert lobes(surface) == close(expected)
    assert told == [MODULE.format(module.rpartition("/")[2]) + ending]


def test_what_shines() -> None:
    text = (
        "bool inputs:enable_emission = 1\n color3f inputs:emissive_color = (1, 0.5, 0)\n float inputs:emissive_intensity = 100"
    )
    assert described(stage("OmniPBR.mdl", text))[0].emissive_color == (100.0, 50.0, 0.0)
    text = "float inputs:emission_weight = 0.5\n float inputs:emission_intensity = 100\n"
    text += "color3f inputs:emission_color = (1, 0.5, 0)"
    assert described(stage("OmniSurface.mdl", text))[0].emissive_color == (50.0, 25.0, 0.0)


def test_opacity() -> None:
    surface, _ = described(
        stage("OmniPBR_Opacity.mdl", "bool inputs:enable_opacity = 1\n float inputs:opacity_constant = 0.25")
    )
    assert (surface.opacity, surface.presence) == (0.25, True)
    surface, _ = described(stage("OmniSurface.mdl", "float inputs:geometry_opacity = 0.25"))
    assert (surface.opacity, surface.presence) == (0.25, True)


def test_a_coat_over_a_normal_map_is_told(image: str) -> None:
    text = f"bool inputs:enable_clearcoat = 1\n asset inputs:normalmap_texture = @{image}@"
    assert "part: clearcoat_normalmap_texture." in described(stage("OmniPBR_ClearCoat.mdl", text))[1][0]


def test_textures_are_where_the_material_says(image: str) -> None:
    text = f"asset inputs:diffuse_texture = @{image}@\n float2 inputs:texture_scale = (2, 3)\n"
    text += "float inputs:albedo_brightness = 0.5"
    surface, _ = surface_of(stage("OmniPBR.mdl", text))
    made = dict(surface.inputs)["open_pbr_base_color"]
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
    assert found == {"open_pbr_specular_roughness": "g", "open_pbr_base_metalness": "b"}


def test_other_modules_leave_the_display_color() -> None:
    surface, told = surface_of(stage("my/own.mdl", ""))
    assert surface.path == ""
    assert told == [("shader-ignored", "/m")]


def told_of(module: str, inputs: str) -> str:
    return described(stage(module, inputs))[1][-1]


def test_alpha_of_a_gltf_texture(image: str) -> None:
    texels = f"asset inputs:base_color_texture = @{image}@\n float inputs:base_alpha = 0.5\n"
    opaque, _ = surface_of(stage("gltf/pbr.mdl", texels))
    assert ("opacity" in opaque.varying, opaque.presence, opaque.opacity_threshold) == (False, False, 0.0)
    masked, told = surface_of(stage("gltf/pbr.mdl", texels + "int inputs:alpha_mode = 1\n float inputs:alpha_cutoff = 0.25"))
    made = dict(masked.inputs)["opacity"]
    assert isinstance(made, TextureInput)
    assert (made.channels, made.scale[3], masked.opacity_threshold, masked.presence) == ("a", 0.5, 0.25, False)
    assert masked.pattern is None
    assert [code for code, _ in told] == ["mdl-material"]
    blended, _ = surface_of(stage("gltf/pbr.mdl", texels + "int inputs:alpha_mode = 2"))
    assert ("opacity" in blended.varying, blended.presence, blended.opacity_threshold) == (True, True, 0.0)
    assert dict(blended.inputs)["open_pbr_base_color"] == dict(opaque.inputs)["open_pbr_base_color"]
    assert "part: alpha_mode." in told_of("gltf/pbr.mdl", "int inputs:alpha_mode = 7")


def test_a_texture_is_at_the_coordinates_of_its_set(image: str) -> None:
    surface, _ = surface_of(stage("OmniPBR.mdl", f"asset inputs:diffuse_texture = @{image}@\n int inputs:uv_space_index = 1"))
    made = dict(surface.inputs)["open_pbr_base_color"]
    assert isinstance(made, TextureInput)
    assert made.st.name == "st1"


LOOKUP = """
        float inputs:roughness_factor.connect = </m/other.outputs:out>
        asset inputs:base_color_texture.connect = </m/lookup.outputs:out>
        token outputs:out
    }
    def Shader "other"
    {
        uniform token info:id = "other"
        float outputs:out
    }
    def Shader "lookup"
    {
        asset inputs:texture = @IMAGE@
        int inputs:tex_coord_index = 1
        float2 inputs:offset = (0.5, 0)"""


def test_a_lookup_has_a_set_and_what_else_it_says_is_reported(image: str) -> None:
    text = stage("gltf/pbr.mdl", LOOKUP.replace("IMAGE", image))
    surface, told = described(text)
    made = dict(surface.inputs)["open_pbr_base_color"]
    assert isinstance(made, TextureInput)
    assert made.st.name == "st1"
    assert "part: base_color_texture.offset, roughness_factor." in told[-1]


@pytest.mark.parametrize(
    ("module", "inputs", "lost"),
    [
        ("OmniPBR.mdl", "bool inputs:project_uvw = 1", "project_uvw"),
        ("OmniPBR.mdl", "bool inputs:project_uvw = 0", ""),
        ("OmniPBR.mdl", "asset inputs:ao_texture = @a.png@", ""),
        ("OmniGlass.mdl", "color3f inputs:reflection_color = (1, 0, 0)", "reflection_color"),
        ("UsdPreviewSurface.mdl", "int inputs:opacityMode = 1", "opacityMode"),
        ("UsdPreviewSurface.mdl", "float inputs:displacement = 0.5", "displacement"),
    ],
)
def test_inputs_without_effect_are_reported_unless_they_are_at_rest(module: str, inputs: str, lost: str) -> None:
    assert told_of(module, inputs).endswith(f"part: {lost}." if lost else "not interpreted.")
