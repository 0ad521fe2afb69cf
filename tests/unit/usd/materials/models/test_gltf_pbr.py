"""gltf_pbr in OpenPBR's words."""

from __future__ import annotations

import math
from typing import Any

import pytest
from tests.unit.usd.known_surface_text import close, image_node, known, lobes, near, unused
from tests.unit.usd.material_text import material
from tests.unit.usd.usd_text import translate_text

from primray.description import PatternInput, TextureInput

SHADER = "ND_gltf_pbr_surfaceshader"
DIELECTRIC = "float inputs:metallic = 0\n"
GLASS = f"{DIELECTRIC} float inputs:transmission = 1\n"
COAT = {"coat_weight": 1.0, "coat_ior": 1.5, "coat_darkening": 0.0, "coat_roughening": 0.0}
ROOT = math.sqrt(0.02)  # of half of what 1.5 reflects

# Inputs, what differs from OpenPBR's defaults (but base and roughness, which are 1), what is told.
CASES: dict[str, tuple[str, dict[str, Any], list[str]]] = {
    "nothing": ("", {"base_metalness": 1.0}, []),
    "dielectric": (f"{DIELECTRIC} float inputs:ior = 1.4", {"specular_ior": 1.4}, []),
    "anisotropy": (
        f"{DIELECTRIC} float inputs:roughness = 0.5\n float inputs:anisotropy_strength = 0.5",
        {
            "specular_roughness": ((0.4375**2 + 0.25**2) / 2) ** 0.25,
            "specular_roughness_anisotropy": 1 - 0.25 / 0.4375,
        },
        [],
    ),
    "specular": (f"{DIELECTRIC} float inputs:specular = 0.5", {"specular_weight": 0.5}, near("specular")),
    "specular of metal": ("float inputs:specular = 0.5", {"base_metalness": 1.0}, []),
    "specular of glass": (
        f"{GLASS} float inputs:specular = 0.5",
        {"transmission_weight": 1.0, "specular_color": (0.5, 0.5, 0.5)},
        near("specular"),
    ),
    "a grey specular color": (
        f"{DIELECTRIC} color3f inputs:specular_color = (0.5, 0.5, 0.5)",
        {"specular_ior": (1 + ROOT) / (1 - ROOT)},
        [],
    ),
    "a specular color": (
        f"{DIELECTRIC} color3f inputs:specular_color = (2, 1, 0)",
        {"specular_ior": (1 + math.sqrt(0.08)) / (1 - math.sqrt(0.08)), "specular_color": (1.0, 0.5, 0.0)},
        near("specular_color"),
    ),
    "a specular color of metal": ("color3f inputs:specular_color = (1, 0.5, 0)", {"base_metalness": 1.0}, []),
    "sheen": (
        f"{DIELECTRIC} color3f inputs:sheen_color = (0.5, 0.25, 0)\n float inputs:sheen_roughness = 0.5",
        {"fuzz_weight": 0.5, "fuzz_color": (1.0, 0.5, 0.0), "fuzz_roughness": 0.25**0.4},
        near("sheen_color"),
    ),
    "clearcoat": (
        f"{DIELECTRIC} float inputs:clearcoat = 1\n float inputs:clearcoat_roughness = 0.25",
        {**COAT, "coat_roughness": 0.25, "specular_ior": 2.25},
        [],
    ),
    "clearcoat on glass": (f"{GLASS} float inputs:clearcoat = 1", {**COAT, "transmission_weight": 1.0}, near("clearcoat")),
    "iridescence": (
        f"{DIELECTRIC} float inputs:iridescence = 0.5\n float inputs:iridescence_thickness = 300\n"
        "float inputs:iridescence_ior = 2",
        {"thin_film_weight": 0.5, "thin_film_thickness": 0.3, "thin_film_ior": 2.0},
        [],
    ),
    "dispersion": (
        f"{GLASS} float inputs:dispersion = 0.5",
        {"transmission_weight": 1.0, "transmission_dispersion_scale": 0.5},
        [],
    ),
    "much dispersion": (
        f"{GLASS} float inputs:dispersion = 2",
        {"transmission_weight": 1.0, "transmission_dispersion_scale": 1.0, "transmission_dispersion_abbe_number": 10.0},
        [],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_values(case: str) -> None:
    inputs, expected, told = CASES[case]
    surface, found = known(SHADER, inputs)
    assert lobes(surface) == close({"base_color": (1.0, 1.0, 1.0), "specular_roughness": 1.0, **expected})
    assert (found, surface.thin) == (told, False)


def test_transmission_is_tinted_by_the_base() -> None:
    assert lobes(known(SHADER, f"{GLASS} color3f inputs:base_color = (1, 0.5, 0)")[0])["transmission_color"] == (1.0, 0.5, 0.0)


ATTENUATION = f"""{GLASS} float inputs:thickness = 1
    color3f inputs:attenuation_color = (1, 0.5, 0)
    float inputs:attenuation_distance = 2
    """


def test_attenuation_fills_what_has_a_thickness() -> None:
    surface, told = known(SHADER, f"{ATTENUATION} color3f inputs:base_color = (1, 1, 1)")
    assert (lobes(surface)["transmission_color"], lobes(surface)["transmission_depth"], told) == ((1.0, 0.5, 0.0), 2.0, [])


def test_glass_that_its_base_tints_has_no_interior_besides() -> None:
    surface, told = known(SHADER, f"{ATTENUATION} color3f inputs:base_color = (1, 0, 0)")
    assert (lobes(surface)["transmission_color"], told) == ((1.0, 0.0, 0.0), unused("attenuation_distance"))


def test_what_has_no_thickness_does_not_attenuate() -> None:
    assert known(SHADER, ATTENUATION.replace("thickness = 1", "thickness = 0"))[1] == []


ALPHA = "float inputs:alpha = 0.25\n int inputs:alpha_mode = "


def test_alpha() -> None:
    opaque, blended = (known(SHADER, f"{GLASS} {ALPHA}{mode}")[0] for mode in (0, 2))
    assert (opaque.opacity, opaque.presence) == (1.0, False)
    assert (blended.opacity, blended.presence, blended.transmits) == (0.25, True, True)
    assert translate_text(material(f"{GLASS} {ALPHA}1", shader=SHADER))[0].shapes == ()  # a mask leaves nothing of it
    whole, _ = known(SHADER, f"{GLASS} {ALPHA}1".replace("0.25", "0.75"))
    assert (whole.opacity, whole.presence, whole.opacity_threshold) == (1.0, False, 0.0)


def test_a_mask_that_varies_is_a_cutout_also_of_glass(image: str) -> None:
    text = f"{GLASS} float inputs:alpha.connect = </m/image.outputs:out>\n int inputs:alpha_mode = 1"
    surface, _ = known(SHADER, text, image_node(image))
    assert isinstance(dict(surface.inputs)["opacity"], TextureInput)
    assert (surface.opacity_threshold, surface.presence, surface.transmits) == (0.5, False, True)


def test_rotation_turns_the_tangent_the_other_way_in_radians() -> None:
    said = {"roughness": 0.5, "anisotropy_strength": 0.5, "anisotropy_rotation": math.pi / 2}
    surface, _ = known(SHADER, "\n".join(f"float inputs:{name} = {value}" for name, value in said.items()))
    made = dict(surface.inputs)["tangent"]
    assert isinstance(made, PatternInput)
    assert surface.pattern is not None
    assert dict(surface.pattern.nodes[made.source.node].inputs)["amount"] == (pytest.approx(-90.0),)
