"""White OpenPBR surfaces send on all the light of a white sky: what is lost between facets comes back, and layers take from
what is below them what they reflect.

Tolerances are what was measured (the notes of each case), over roughness, layers and angles; nothing gains more than they say.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.statistics.surfaces.open_pbr.open_pbr_cases import WHITE, albedo, direction, surface

COSINES = (1.0, 0.7, 0.3, 0.1, 0.03)
METAL = {"base_color": WHITE, "base_metalness": 1.0}
GLASS = {"transmission_weight": 1.0}
# Name: inputs, and how far the sum may be from 1 from a cosine of 0.1 on, and below.
FURNACES: dict[str, tuple[dict[str, Any], float, float]] = {
    "diffuse": ({"base_color": WHITE, "specular_weight": 0.0}, 1e-5, 1e-5),
    "rough diffuse": ({"base_color": WHITE, "specular_weight": 0.0, "base_diffuse_roughness": 1.0}, 1e-3, 1e-3),
    **{f"metal {r}": ({**METAL, "specular_roughness": r}, 1e-3, 1e-3) for r in (0.0, 0.05, 0.3, 0.7, 1.0)},
    **{f"dielectric {r}": ({"base_color": WHITE, "specular_roughness": r}, 1e-3, 1.5e-3) for r in (0.0, 0.1, 0.3, 0.6, 1.0)},
    "ior 1.1": ({"base_color": WHITE, "specular_ior": 1.1, "specular_roughness": 0.4}, 1.5e-3, 2e-3),
    "ior 2.5": ({"base_color": WHITE, "specular_ior": 2.5, "specular_roughness": 0.5}, 2e-3, 2e-3),
    "half metal": ({"base_color": WHITE, "base_metalness": 0.5}, 1e-3, 1e-3),
    **{
        f"brushed metal {a}": ({**METAL, "specular_roughness": 0.5, "specular_roughness_anisotropy": a}, 6e-3, 6e-3)
        for a in (0.3, 0.6, 0.9)
    },
    "brushed dielectric": (
        {"base_color": WHITE, "specular_roughness": 0.6, "specular_roughness_anisotropy": 0.7},
        1.2e-2,
        2e-2,
    ),
    **{f"glass {r}": ({**GLASS, "specular_roughness": r}, 2e-3, 4e-3) for r in (0.0, 0.2, 0.5, 1.0)},
    "dense glass": ({**GLASS, "specular_roughness": 0.4, "specular_ior": 2.4}, 2e-3, 4e-3),
    "brushed glass": ({**GLASS, "specular_roughness": 0.4, "specular_roughness_anisotropy": 0.6}, 1.5e-2, 1.5e-2),
    "dispersive glass": ({**GLASS, "transmission_dispersion_scale": 1.0}, 3e-3, 4e-3),
    "half glass": ({"base_color": WHITE, "transmission_weight": 0.5}, 2e-3, 2e-3),
    "pane": ({**GLASS, "specular_roughness": 0.0, "thin": True}, 1e-5, 1e-5),
    "frosted pane": ({**GLASS, "specular_roughness": 0.5, "thin": True}, 2e-3, 4e-3),
    "leaf": ({"subsurface_weight": 1.0, "subsurface_color": WHITE, "thin": True}, 1e-3, 2e-3),
    "subsurface": ({"subsurface_weight": 1.0, "subsurface_color": WHITE}, 1e-3, 1.5e-3),
    **{f"coat {r}": ({"base_color": WHITE, "coat_weight": 1.0, "coat_roughness": r}, 2e-3, 2e-3) for r in (0.0, 0.3, 0.8)},
    "coat in parts": ({"base_color": WHITE, "coat_weight": 0.6, "coat_roughness": 0.4}, 2e-3, 2e-3),
    "coat on metal": ({**METAL, "coat_weight": 1.0, "coat_roughness": 0.3}, 2e-3, 2e-3),
    "coat on glass": ({**GLASS, "coat_weight": 0.7, "coat_roughness": 0.2}, 4e-3, 6e-3),
    "fuzz": ({"base_color": WHITE, "fuzz_weight": 1.0}, 1e-3, 1e-3),
    "fuzz on metal": ({**METAL, "fuzz_weight": 0.7, "fuzz_roughness": 0.2}, 1e-3, 2e-3),
    "thin film": ({"base_color": WHITE, "thin_film_weight": 1.0}, 8e-3, 8e-3),
    "soap bubble": ({**GLASS, "specular_roughness": 0.0, "thin_film_weight": 1.0, "thin": True}, 1e-4, 1e-4),
    "thin film on glass": ({**GLASS, "thin_film_weight": 1.0}, 4e-3, 4e-3),
}


@pytest.mark.parametrize("name", FURNACES)
def test_white_surfaces_lose_nothing(name: str) -> None:
    case, wide, grazing = FURNACES[name]
    made = surface(case)
    for cosine in COSINES:
        for azimuth in (0.0, 0.7, 1.57):
            found = albedo(made, direction(cosine, azimuth), n=384)
            np.testing.assert_allclose(found, 1, atol=wide if cosine >= 0.1 else grazing, err_msg=f"{cosine} {azimuth}")
            if not case.get("specular_roughness_anisotropy"):
                break


@pytest.mark.parametrize(
    "name", [n for n, (case, _, _) in FURNACES.items() if case.get("transmission_weight") and not case.get("thin")]
)
def test_nor_does_white_glass_from_within(name: str) -> None:
    made = surface(FURNACES[name][0])
    for cosine in (1.0, 0.85, 0.7, 0.3, 0.1):
        found = albedo(made, direction(cosine, 0.0), front=False, n=768)
        # The loss between brushed facets goes by that of reflection alone.
        np.testing.assert_allclose(found, 1, atol=6e-2 if "brushed" in name else 8e-3, err_msg=str(cosine))


@pytest.mark.parametrize("name", FURNACES)
def test_black_inputs_take_light_away(name: str) -> None:
    """The furnaces can fail: darker colours are darker."""
    case = dict(FURNACES[name][0])
    grey = (0.5, 0.5, 0.5)
    dark = {**case, "base_color": grey, "subsurface_color": grey, "transmission_color": grey}
    assert (albedo(surface(dark), direction(0.7), n=128) < 0.97).all()
