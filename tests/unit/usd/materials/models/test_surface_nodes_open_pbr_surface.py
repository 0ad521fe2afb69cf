"""open_pbr_surface: every input in its place."""

from __future__ import annotations

from dataclasses import fields

import pytest
from tests.unit.usd.known_surface_text import close, known, lobes, unused

from primray.description import OpenPbr, PatternInput

SHADER = "ND_open_pbr_surface_surfaceshader"
LOBES = "".join(f"float inputs:{lobe}_weight = 0.5\n" for lobe in ("transmission", "subsurface", "fuzz", "coat", "thin_film"))


def test_its_defaults_are_the_records() -> None:
    surface, told = known(SHADER)
    assert (surface.open_pbr, surface.inputs, told) == (OpenPbr(), (), [])
    assert (surface.opacity, surface.presence, surface.thin, surface.emissive_color) == (1.0, False, False, (0.0, 0.0, 0.0))


@pytest.mark.parametrize("name", [f.name for f in fields(OpenPbr) if f.name != "coat_roughening"])
def test_each_input_has_its_field(name: str) -> None:
    default = getattr(OpenPbr(), name)
    kind, said, value = (
        ("color3f", "(0.5, 0.25, 0)", (0.5, 0.25, 0.0)) if isinstance(default, tuple) else ("float", "0.75", 0.75)
    )
    lobe_on = "\n".join(line for line in LOBES.splitlines() if not line.startswith(f"float inputs:{name} "))
    made = known(SHADER, f"{lobe_on}\n{kind} inputs:{name} = {said}")[0].open_pbr
    assert made is not None
    assert getattr(made, name) == value


def test_inputs_of_lobes_that_are_off_stay_out() -> None:
    text = "color3f inputs:coat_color = (1, 0, 0)\n float inputs:fuzz_roughness = 0.25\n float inputs:thin_film_ior = 2"
    surface, told = known(SHADER, text)
    assert (lobes(surface), told) == ({}, [])


def test_lobes_below_metal_stay_out() -> None:
    text = "float inputs:base_metalness = 1\n float inputs:transmission_weight = 1\n float inputs:subsurface_weight = 1"
    surface, told = known(SHADER, text)
    assert (lobes(surface), surface.transmits, told) == ({"base_metalness": 1.0}, False, [])


def test_emission_is_its_luminance_times_its_color() -> None:
    text = "float inputs:emission_luminance = 100\n color3f inputs:emission_color = (1, 0.5, 0)"
    assert known(SHADER, text)[0].emissive_color == (100.0, 50.0, 0.0)


def test_opacity_is_how_much_is_there_whatever_passes_through() -> None:
    surface, told = known(SHADER, "float inputs:geometry_opacity = 0.25\n float inputs:transmission_weight = 0.5")
    assert (surface.opacity, surface.presence, told) == (0.25, True, [])
    assert lobes(surface) == {"transmission_weight": 0.5}


def test_a_depth_fills_the_interior_but_of_thin_walls() -> None:
    text = "float inputs:transmission_weight = 1\n color3f inputs:transmission_color = (1, 0.5, 0)\n"
    assert lobes(known(SHADER, text)[0])["transmission_color"] == (1.0, 0.5, 0.0)
    deep = f"{text} float inputs:transmission_depth = 2\n color3f inputs:transmission_scatter = (0.5, 0.25, 0)\n"
    surface, told = known(SHADER, deep)
    inside = {"transmission_depth": 2.0, "transmission_scatter": (0.5, 0.25, 0.0), "transmission_color": (1.0, 0.5, 0.0)}
    assert (lobes(surface), told) == ({"transmission_weight": 1.0, **inside}, [])
    assert known(SHADER, f"{deep} bool inputs:geometry_thin_walled = 1")[1] == unused(
        "transmission_depth", "transmission_scatter"
    )


def test_scattering_without_a_depth_has_no_effect() -> None:
    text = "float inputs:transmission_weight = 1\n color3f inputs:transmission_scatter = (0.5, 0.25, 0)\n"
    assert known(SHADER, text)[1] == unused("transmission_scatter")


def test_subsurface_has_a_radius() -> None:
    text = "float inputs:subsurface_weight = 0.5\n float inputs:subsurface_radius = 3\n"
    surface, told = known(SHADER, text)
    assert (lobes(surface), told) == ({"subsurface_weight": 0.5, "subsurface_radius": 3.0}, [])
    surface, told = known(SHADER, f"{text} bool inputs:geometry_thin_walled = 1")
    assert (surface.thin, told) == (True, [])


NORMALS = """
    def Shader "n{i}"
    {{
        uniform token info:id = "ND_geompropvalue_vector3"
        string inputs:geomprop = "own{i}"
        float3 outputs:out
    }}"""
COATED = "float inputs:coat_weight = 1\n float3 inputs:geometry_normal.connect = </m/n0.outputs:out>\n"


@pytest.mark.parametrize(("coat", "told"), [(0, []), (1, unused("geometry_coat_normal"))])
def test_a_coats_own_normal_is_told(coat: int, told: list[str]) -> None:
    nodes = NORMALS.format(i=0) + NORMALS.format(i=1)
    text = f"{COATED} float3 inputs:geometry_coat_normal.connect = </m/n{coat}.outputs:out>"
    assert known(SHADER, text, nodes)[1] == told


def test_a_coat_that_is_smooth_over_a_bumpy_base_is_told() -> None:
    assert known(SHADER, COATED, NORMALS.format(i=0))[1] == unused("geometry_coat_normal")


@pytest.mark.parametrize("of", ["specular", "coat"])
def test_anisotropy_reads_a_tangent(of: str) -> None:
    surface, told = known(SHADER, f"float inputs:coat_weight = 1\n float inputs:{of}_roughness_anisotropy = 0.5")
    assert told == []
    made = dict(surface.inputs)["tangent"]
    assert isinstance(made, PatternInput)
    assert surface.pattern is not None
    node = surface.pattern.nodes[made.source.node]
    assert (node.category, dict(node.inputs)["space"]) == ("tangent", "world")


TANGENT = "float3 inputs:{name}.connect = </m/n0.outputs:out>\n"


def test_a_tangent_without_anisotropy_is_not_read() -> None:
    surface, told = known(SHADER, TANGENT.format(name="geometry_tangent"), NORMALS.format(i=0))
    assert (surface.inputs, surface.pattern, told) == ((), None, [])


def test_the_coats_tangent_is_the_surfaces_where_the_base_needs_none() -> None:
    text = "float inputs:coat_weight = 1\n float inputs:coat_roughness_anisotropy = 0.5\n"
    own = TANGENT.format(name="geometry_coat_tangent")
    surface, told = known(SHADER, text + own, NORMALS.format(i=0))
    assert surface.pattern is not None
    assert ([node.category for node in surface.pattern.nodes], told) == (["geompropvalue"], [])
    told = known(SHADER, f"{text} float inputs:specular_roughness_anisotropy = 0.5\n {own}", NORMALS.format(i=0))[1]
    assert told == unused("geometry_coat_tangent")


def test_values_beyond_their_range_are_clamped() -> None:
    text = "float inputs:specular_roughness = -1\n color3f inputs:base_color = (2, 0.5, -1)\n float inputs:specular_weight = 2"
    expected = {"specular_roughness": 0.0, "base_color": (1.0, 0.5, 0.0), "specular_weight": 2.0}
    assert lobes(known(SHADER, text)[0]) == close(expected)
