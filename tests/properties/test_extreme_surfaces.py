"""Surface nodes whose inputs have the strangest numbers: what becomes of them is finite and in range."""

from __future__ import annotations

import math
import random
from dataclasses import fields

import pytest
from tests.unit.usd.known_surface_text import known

from primray.description import OpenPbr
from primray.usd.materials.materialx.definitions import definition
from primray.usd.materials.models.surface_nodes import SURFACE_READERS

NUMBERS = ["-1", "0", "1e-30", "0.5", "1", "3", "1e30", "-1e30"]
WIDE = (
    "specular_weight",
    "specular_ior",
    "coat_ior",
    "thin_film_ior",
    "thin_film_thickness",
    "transmission_dispersion_abbe_number",
    "transmission_depth",
    "transmission_scatter",
    "subsurface_radius",
    "subsurface_radius_scale",
)
SIGNED = ("subsurface_scatter_anisotropy", "transmission_scatter_anisotropy")


@pytest.mark.parametrize("shader", SURFACE_READERS)
def test_extreme_inputs(shader: str) -> None:
    rng = random.Random(shader)
    found = definition(shader)
    assert found is not None
    widths = {i.name: (i.type, 3 if i.type == "color3" else 1) for i in found.inputs if i.type in ("float", "color3")}
    for _ in range(300):
        some = [name for name in widths if rng.random() < 0.6]
        text = ""
        for name in some:
            kind, width = widths[name]
            numbers = ", ".join(rng.choice(NUMBERS) for _ in range(width))
            text += f"color3f inputs:{name} = ({numbers})\n" if kind == "color3" else f"float inputs:{name} = {numbers}\n"
        surface, _ = known(shader, text)
        values = {f.name: getattr(surface.open_pbr, f.name) for f in fields(OpenPbr)} if surface.open_pbr else {}
        values |= {"emissive_color": surface.emissive_color, "opacity": surface.opacity}
        for name, value in values.items():
            for number in value if isinstance(value, tuple) else (value,):
                assert math.isfinite(number), (name, text)
                low = -1.0 if name in SIGNED else 0.0
                assert low <= number <= (1e30 if name in WIDE or name == "emissive_color" else 1.0), (name, text)
