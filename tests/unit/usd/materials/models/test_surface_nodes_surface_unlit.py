"""surface_unlit: emission and nothing else."""

from __future__ import annotations

import pytest
from tests.unit.usd.known_surface_text import known, unused

SHADER = "ND_surface_unlit"


def test_it_shines_and_reflects_nothing() -> None:
    surface, told = known(SHADER, "float inputs:emission = 2\n color3f inputs:emission_color = (1, 0.5, 0)")
    assert (surface.lambert, surface.open_pbr, surface.diffuse_color, told) == (True, None, (0.0, 0.0, 0.0), [])
    assert (surface.emissive_color, surface.opacity, surface.presence) == ((2.0, 1.0, 0.0), 1.0, False)


def test_opacity_is_how_much_is_there() -> None:
    surface, _ = known(SHADER, "float inputs:opacity = 0.25")
    assert (surface.opacity, surface.presence, surface.thin) == (0.25, True, True)


@pytest.mark.parametrize("transmission", [0.25, 0.5, 1.0])
def test_what_passes_takes_nothing_from_what_shines(transmission: float) -> None:
    surface, told = known(SHADER, f"float inputs:transmission = {transmission}\n float inputs:opacity = 0.5")
    assert told == []
    assert surface.opacity == pytest.approx(0.5 * (1 - transmission), abs=1e-3)
    assert surface.opacity * surface.emissive_color[0] == pytest.approx(0.5)


def test_a_colour_of_what_passes_is_told() -> None:
    text = "float inputs:transmission = 0.5\n color3f inputs:transmission_color = (1, 0, 0)"
    assert known(SHADER, text)[1] == unused("transmission_color")
