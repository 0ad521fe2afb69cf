"""A record as a surface: which of a material's outputs it is of, thin walls, what varies."""

from __future__ import annotations

import pytest
from tests.unit.usd.known_surface_text import described, image_node, known, lobes
from tests.unit.usd.material_text import material

from primray.description import TextureInput
from primray.settings import RenderSettings
from primray.usd.materials.models.open_pbr import input_report

OPEN_PBR = "ND_open_pbr_surface_surfaceshader"
STANDARD = "ND_standard_surface_surfaceshader"


def test_thin_walls_let_light_straight_through() -> None:
    glass = "float inputs:transmission = 1\n bool inputs:thin_walled = 1"
    assert known(STANDARD, glass)[0].thin
    assert not known(STANDARD, "float inputs:transmission = 1")[0].thin


@pytest.mark.parametrize(
    ("inputs", "thin"),
    [
        ("float inputs:transmission_weight = 0.5", True),
        ("float inputs:transmission_weight = 0", False),
        ("float inputs:geometry_opacity = 0.5", False),  # what is there of it is as thick as before
    ],
)
def test_open_meshes_are_thin_where_light_goes_through_them(inputs: str, thin: bool) -> None:
    mesh = """
def Mesh "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    rel material:binding = </m>
}
"""
    text = material(inputs, shader=OPEN_PBR)
    surface, _ = described(text[: text.index('def Sphere "ball"')] + mesh)
    assert (surface.open_pbr is not None, surface.thin) == (True, thin)


def test_what_bends_nothing_is_thin() -> None:
    text = "float inputs:transmission_weight = 1\n float inputs:specular_ior = 1"
    assert known(OPEN_PBR, text)[0].thin
    assert not known(OPEN_PBR, f"{text}\n float inputs:coat_weight = 1")[0].thin


def test_inputs_that_vary_have_constants_in_their_place(image: str) -> None:
    text = "color3f inputs:base_color.connect = </m/image.outputs:out>\n float inputs:transmission_weight = 0.5"
    surface, messages = known(OPEN_PBR, text, image_node(image, "color3"))
    assert isinstance(dict(surface.inputs)["open_pbr_base_color"], TextureInput)
    assert lobes(surface) == {"base_color": (0.0, 0.0, 0.0), "transmission_weight": 0.5}  # the image's default
    assert messages == []


def test_inputs_of_lobes_that_are_off_read_nothing(image: str) -> None:
    text = "float inputs:coat_roughness.connect = </m/image.outputs:out>"
    assert known(OPEN_PBR, text, image_node(image))[0].inputs == ()
    assert len(known(OPEN_PBR, f"{text}\n float inputs:coat_weight = 1", image_node(image))[0].inputs) == 1


def test_a_transmission_that_varies_lets_light_through(image: str) -> None:
    surface, _ = known(OPEN_PBR, "float inputs:transmission_weight.connect = </m/image.outputs:out>", image_node(image))
    assert surface.transmits


def test_materialx_comes_before_the_universal_output() -> None:
    both = "token outputs:mtlx:surface.connect = </m/x.outputs:out>"
    said = f'uniform token info:id = "{OPEN_PBR}"\n float inputs:specular_roughness = 0.75'
    other = f'def Shader "x" {{\n {said}\n token outputs:out\n}}'
    surface, _ = described(material("float inputs:roughness = 0.25", other, both))
    assert lobes(surface) == {"specular_roughness": 0.75}
    surface, _ = described(material("float inputs:roughness = 0.25", other, both), RenderSettings(render_context="universal"))
    assert (surface.open_pbr, surface.roughness) == (None, 0.25)
    unknown = other.replace(OPEN_PBR, "ND_surface")
    surface, _ = described(material("float inputs:roughness = 0.25", unknown, both))
    assert (surface.open_pbr, surface.roughness) == (None, 0.25)


def test_each_name_is_told_once_and_in_order() -> None:
    found = input_report(("depth", "a"), ("coat", "a", "base"))
    assert found.sentences() == "Approximated: base, coat. Not supported, or only in part: a, depth."
    assert input_report((), ()).sentences() == ""
