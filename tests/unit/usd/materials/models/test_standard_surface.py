"""standard_surface in OpenPBR's words: values, and what is told of those that mean something else."""

from __future__ import annotations

from typing import Any

import pytest
from tests.unit.usd.known_surface_text import close, image_node, known, lobes, near, unused

from primray.description import PatternInput, TextureInput

SHADER = "ND_standard_surface_surfaceshader"
COAT = {"coat_weight": 1.0, "coat_ior": 1.5, "coat_darkening": 0.0, "coat_roughening": 0.0}
GLASS = "float inputs:transmission = 1"
HALF = 1.0 - 0.5  # of an anisotropy of 0.5: the narrower width over the wider one

# Inputs, what differs from OpenPBR's defaults (but the roughness of 0.2), what is approximated.
CASES: dict[str, tuple[str, dict[str, Any], list[str]]] = {
    "nothing": ("", {}, []),
    "base": (
        "float inputs:base = 0.5\n color3f inputs:base_color = (1, 0.5, 0)",
        {"base_weight": 0.5, "base_color": (1.0, 0.5, 0.0)},
        [],
    ),
    "diffuse roughness": ("float inputs:diffuse_roughness = 0.5", {"base_diffuse_roughness": 0.5}, near("diffuse_roughness")),
    "no specular": ("float inputs:specular = 0", {"specular_weight": 0.0}, []),
    "half specular": ("float inputs:specular = 0.5", {"specular_weight": 0.5}, near("specular")),
    "half specular of glass": (
        f"float inputs:specular = 0.5\n {GLASS}",
        {"specular_color": (0.5, 0.5, 0.5), "transmission_weight": 1.0},
        near("specular"),
    ),
    "specular color": ("color3f inputs:specular_color = (1, 0.5, 0)", {"specular_color": (1.0, 0.5, 0.0)}, []),
    "metal": ("float inputs:metalness = 1", {"base_metalness": 1.0}, near("metalness")),
    "half specular of metal": (
        "float inputs:metalness = 1\n float inputs:specular = 0.5\n color3f inputs:base_color = (0.5, 0.5, 0.5)",
        {"base_metalness": 1.0, "base_color": (0.5, 0.5, 0.5), "specular_color": (0.75697126,) * 3},
        near("metalness"),
    ),
    "anisotropy": (
        "float inputs:specular_anisotropy = 0.5",
        {"specular_roughness": 0.2 * ((1 / HALF + HALF) / 2) ** 0.25, "specular_roughness_anisotropy": 0.5},
        [],
    ),
    "anisotropy as wide as it goes": (
        "float inputs:specular_anisotropy = 0.75\n float inputs:specular_roughness = 1",
        {"specular_roughness": ((1 + 0.5**2) / 2) ** 0.25, "specular_roughness_anisotropy": 0.5},
        [],
    ),
    "transmission": (
        f"{GLASS}\n color3f inputs:transmission_color = (1, 0.5, 0)\n float inputs:specular_IOR = 1.4",
        {"transmission_weight": 1.0, "transmission_color": (1.0, 0.5, 0.0), "specular_ior": 1.4},
        [],
    ),
    "dispersion": (
        f"{GLASS}\n float inputs:transmission_dispersion = 30",
        {"transmission_weight": 1.0, "transmission_dispersion_scale": 1.0, "transmission_dispersion_abbe_number": 30.0},
        [],
    ),
    "subsurface": (
        "float inputs:subsurface = 0.5\n color3f inputs:subsurface_color = (1, 0.5, 0)\n"
        "float inputs:subsurface_anisotropy = 0.5",
        {
            "subsurface_weight": 0.5,
            "subsurface_color": (1.0, 0.5, 0.0),
            "subsurface_radius_scale": (1.0, 1.0, 1.0),
            "subsurface_scatter_anisotropy": 0.5,
        },
        [],
    ),
    "sheen": (
        "float inputs:sheen = 0.5\n color3f inputs:sheen_color = (1, 0.5, 0)\n float inputs:sheen_roughness = 0.5",
        {"fuzz_weight": 0.5, "fuzz_color": (1.0, 0.5, 0.0), "fuzz_roughness": 0.5**0.4},
        near("sheen"),
    ),
    "coat": (
        "float inputs:coat = 1\n float inputs:coat_roughness = 0.25\n float inputs:coat_anisotropy = 0.5",
        {
            **COAT,
            "coat_roughness": 0.25 * ((1 / HALF + HALF) / 2) ** 0.25,
            "coat_roughness_anisotropy": 0.5,
            "specular_ior": 2.25,
        },
        [],
    ),
    "half a coat": (
        "float inputs:coat = 0.5\n float inputs:coat_roughness = 0",
        {**COAT, "coat_weight": 0.5, "specular_ior": 1.5 / (0.5 + 0.5 / 1.5)},
        [],
    ),
    "a colored coat": (
        "float inputs:coat = 1\n float inputs:coat_roughness = 0\n color3f inputs:coat_color = (1, 0.5, 0)",
        {**COAT, "coat_color": (1.0, 0.5, 0.0), "specular_ior": 2.25},
        near("coat_color"),
    ),
    "a coat that saturates": (
        "float inputs:coat = 0.5\n float inputs:coat_roughness = 0\n float inputs:coat_affect_color = 1\n"
        "color3f inputs:base_color = (1, 0.25, 0)\n float inputs:specular_IOR = 1",
        {**COAT, "coat_weight": 0.5, "base_color": (1.0, 0.125, 0.0), "specular_ior": 1.0 / (0.5 + 0.5 / 1.5)},
        [],
    ),
    "a coat that roughens": (
        "float inputs:coat = 1\n float inputs:coat_roughness = 0.5\n float inputs:coat_affect_roughness = 0.5",
        {**COAT, "coat_roughness": 0.5, "specular_roughness": 0.2 + 0.25 * 0.8, "specular_ior": 2.25},
        [],
    ),
    "a coat on glass": (
        f"float inputs:coat = 1\n float inputs:coat_roughness = 0\n {GLASS}",
        {**COAT, "transmission_weight": 1.0},
        near("coat"),
    ),
    "a thin film": (
        "float inputs:thin_film_thickness = 300\n float inputs:thin_film_IOR = 2",
        {"thin_film_weight": 1.0, "thin_film_thickness": 0.3, "thin_film_ior": 2.0},
        [],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_values(case: str) -> None:
    inputs, expected, told = CASES[case]
    surface, found = known(SHADER, inputs)
    assert lobes(surface) == close({"specular_roughness": 0.2, **expected})
    assert found == told
    assert (surface.opacity, surface.presence, surface.thin) == (1.0, False, False)


def test_the_older_version_differs_in_its_base() -> None:
    made = lobes(known("ND_standard_surface_surfaceshader_100")[0])
    assert made == close({"base_weight": 0.8, "base_color": (1.0, 1.0, 1.0), "specular_roughness": 0.2})


UNUSED = {
    f"{GLASS}\n color3f inputs:transmission_scatter = (1, 0, 0)": "transmission_scatter",
    f"{GLASS}\n float inputs:transmission_extra_roughness = 0.5": "transmission_extra_roughness",
}


@pytest.mark.parametrize("inputs", UNUSED)
def test_what_has_no_effect_is_told_once(inputs: str) -> None:
    surface, told = known(SHADER, inputs)
    assert told == unused(UNUSED[inputs])
    made = lobes(surface)
    made.pop("transmission_scatter", None)
    assert made == close({"specular_roughness": 0.2, "transmission_weight": 1.0})


def test_what_is_out_of_effect_is_not_told() -> None:
    text = "color3f inputs:coat_color = (1, 0, 0)\n float inputs:transmission_depth = 3\n float inputs:sheen_roughness = 0.7"
    assert known(SHADER, text)[1] == []


def test_thin_walls_let_subsurface_light_through_and_nothing_back() -> None:
    surface, told = known(SHADER, "float inputs:subsurface = 0.5\n bool inputs:thin_walled = 1")
    assert (surface.thin, surface.transmits, told) == (True, False, [])
    assert lobes(surface)["subsurface_scatter_anisotropy"] == 1.0


def test_emission() -> None:
    surface, told = known(SHADER, "float inputs:emission = 4\n color3f inputs:emission_color = (1, 0.5, 0)")
    assert (surface.emissive_color, told) == ((4.0, 2.0, 0.0), [])
    coated = "float inputs:emission = 4\n float inputs:coat = 1"
    assert known(SHADER, coated)[1] == near("emission")


def test_opacity_is_the_mean_of_its_channels_and_goes_with_transmission() -> None:
    surface, told = known(SHADER, f"color3f inputs:opacity = (0.25, 0.25, 0.25)\n {GLASS}")
    assert (surface.opacity, surface.presence, surface.transmits, told) == (pytest.approx(0.25), True, True, [])
    surface, told = known(SHADER, "color3f inputs:opacity = (0, 0.25, 0.5)")
    assert (surface.opacity, told) == (pytest.approx(0.25), near("opacity"))


def test_rotation_turns_the_tangent() -> None:
    surface, told = known(SHADER, "float inputs:specular_anisotropy = 0.5\n float inputs:specular_rotation = 0.25")
    assert (surface.pattern is not None, told) == (True, [])
    assert surface.pattern is not None
    made = dict(surface.inputs)["tangent"]
    assert isinstance(made, PatternInput)
    node = surface.pattern.nodes[made.source.node]
    assert node.category == "rotate3d"
    assert dict(node.inputs) == {"in": "Tworld", "amount": (90.0,), "axis": "Nworld"}


def test_two_rotations_are_told() -> None:
    both = "float inputs:coat = 1\n float inputs:coat_anisotropy = 0.5\n float inputs:specular_anisotropy = 0.5\n"
    assert known(SHADER, both)[1] == []
    assert known(SHADER, f"{both} float inputs:coat_rotation = 0.25")[1] == unused("coat_rotation")
    alone = "float inputs:coat = 1\n float inputs:coat_anisotropy = 0.5\n float inputs:coat_rotation = 0.25"
    assert known(SHADER, alone)[1] == []


def test_what_varies(image: str) -> None:
    text = "float inputs:thin_film_thickness.connect = </m/image.outputs:out>"
    surface, _ = known(SHADER, text, image_node(image))
    made = dict(surface.inputs)["open_pbr_thin_film_thickness"]
    assert isinstance(made, TextureInput)
    assert (made.scale[0], lobes(surface)["thin_film_weight"]) == (pytest.approx(1e-3), 1.0)


def test_an_anisotropy_that_varies_is_a_pattern(image: str) -> None:
    text = "float inputs:specular_anisotropy.connect = </m/image.outputs:out>"
    surface, _ = known(SHADER, text, image_node(image))
    assert {name: type(made) for name, made in surface.inputs} == {
        "open_pbr_specular_roughness": PatternInput,
        "open_pbr_specular_roughness_anisotropy": PatternInput,
        "tangent": PatternInput,
    }


def test_a_metalness_that_varies_gives_each_part_its_own_reflections(image: str) -> None:
    text = "float inputs:metalness.connect = </m/image.outputs:out>\n float inputs:specular = 0.5"
    surface, told = known(SHADER, text, image_node(image))
    made = dict(surface.inputs)["open_pbr_specular_weight"]
    assert isinstance(made, TextureInput)
    assert (made.scale[0], made.bias[0]) == (0.5, 0.5)  # 0.5 of dielectrics, 1 of metals
    assert told == near("metalness", "specular")
