"""disney_principled in OpenPBR's words."""

from __future__ import annotations

import math
from typing import Any

import pytest
from tests.unit.usd.known_surface_text import close, image_node, known, lobes, near

from primray.description import TextureInput

SHADER = "ND_disney_principled"
ROOT = math.sqrt(0.08)
MOST = (1 + ROOT) / (1 - ROOT)  # the index of what reflects 0.08
COAT = {"coat_weight": 1.0, "coat_ior": 1.5, "coat_darkening": 0.0, "coat_roughening": 0.0}

# Inputs, what differs from OpenPBR's defaults (but the base of 0.16 and the roughness of 0.5), what is approximated.
CASES: dict[str, tuple[str, dict[str, Any], list[str]]] = {
    "nothing": ("", {"specular_ior": 1.5}, near("roughness")),
    "metal": ("float inputs:metallic = 1", {"base_metalness": 1.0, "specular_ior": 1.5}, []),
    "specular": ("float inputs:specular = 1", {"specular_ior": MOST}, near("roughness")),
    "tint": (
        "float inputs:specularTint = 0.5\n color3f inputs:baseColor = (1, 0.5, 0)",
        {"base_color": (1.0, 0.5, 0.0), "specular_color": (1.0, 0.75, 0.5), "specular_ior": 1.5},
        near("roughness", "specularTint"),
    ),
    "tint of metal": (
        "float inputs:specularTint = 1\n float inputs:metallic = 1",
        {"base_metalness": 1.0, "specular_ior": 1.5},
        [],
    ),
    "anisotropic": (
        "float inputs:anisotropic = 0.5\n float inputs:metallic = 1",
        {
            "base_metalness": 1.0,
            "specular_ior": 1.5,
            "specular_roughness": 0.5 * 1.25**0.25,
            "specular_roughness_anisotropy": 0.5,
        },
        [],
    ),
    "sheen": (
        "float inputs:sheen = 0.5\n color3f inputs:baseColor = (1, 0.5, 0)",
        {
            "base_color": (1.0, 0.5, 0.0),
            "specular_ior": 1.5,
            "fuzz_weight": 0.5,
            "fuzz_color": (1.0, 0.75, 0.5),
            "fuzz_roughness": 0.3**0.4,
        },
        near("roughness", "sheen"),
    ),
    "clearcoat": (
        "float inputs:clearcoat = 1\n float inputs:clearcoatGloss = 0.75",
        {**COAT, "coat_roughness": 0.25, "specular_ior": 2.25},
        near("clearcoat", "roughness"),
    ),
    "glass": (
        "float inputs:specTrans = 1\n color3f inputs:baseColor = (1, 0.5, 0)",
        {"transmission_weight": 1.0, "base_color": (1.0, 0.5, 0.0), "transmission_color": (1.0, 0.5, 0.0)},
        near("roughness"),
    ),
    "glass of another index than its reflections": (
        "float inputs:specTrans = 1\n float inputs:ior = 1.4",
        {"transmission_weight": 1.0, "transmission_color": (0.16, 0.16, 0.16), "specular_ior": 1.4},
        near("roughness", "specular"),
    ),
    "subsurface": (
        "float inputs:subsurface = 1",
        {
            "subsurface_weight": 1.0,
            "subsurface_color": (0.16, 0.16, 0.16),
            "subsurface_radius_scale": (1.0, 1.0, 1.0),
            "specular_ior": 1.5,
        },
        near("subsurface"),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_values(case: str) -> None:
    inputs, expected, told = CASES[case]
    surface, found = known(SHADER, inputs)
    common = {"base_color": (0.16, 0.16, 0.16), "specular_roughness": 0.5, "specular_ior": 1.5}
    made = {"specular_ior": 1.5, **lobes(surface)}
    assert made == close({**common, **expected})
    assert found == told


def test_a_specular_that_varies_is_a_weight(image: str) -> None:
    surface, _ = known(SHADER, "float inputs:specular.connect = </m/image.outputs:out>", image_node(image))
    assert isinstance(dict(surface.inputs)["open_pbr_specular_weight"], TextureInput)
    assert lobes(surface)["specular_ior"] == pytest.approx(MOST)
