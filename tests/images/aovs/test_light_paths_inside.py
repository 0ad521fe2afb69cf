"""Light path expressions where light goes through bodies: media, subsurface, hair."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.images.aovs.seen import stage_of
from tests.images.open_pbr.test_interiors import SKY, SUN, THIN_AIR, ball, material

from primray import Image, render

NAMES = ("C[LO]", "C<RD>[LO]", "C<RD>.+[LO]", "C<R[GS]>.*[LO]", "C<T.>.*[LO]", "CV[LO]", "CV.+[LO]")


def picture(text: str, *more: str, **settings: Any) -> Image:
    asked: dict[str, Any] = {"resolution": (24, 18), "spp": 32, "seed": 3, "threads": 1, "aovs": (*NAMES, *more)} | settings
    return render(stage_of(text, light=""), progress=False, **asked)


def means(image: Image) -> dict[str, float]:
    picture = image.pixels[..., :3]
    parts = np.sum([image.aovs[name].values for name in NAMES], axis=0, dtype=np.float64)
    assert np.array_equal(parts.astype(np.float32), picture)
    return {name: float(aov.values.mean()) for name, aov in image.aovs.items() if aov.values.any()}


def test_mist_scatters_by_events_of_its_own() -> None:
    """A ball of mist without a boundary, in the sun: at depth 1 all its light is of one scattering."""
    mist = {"transmission_depth": 1.0, "transmission_color": (0.5, 0.5, 0.5), "transmission_scatter": (0.6, 0.6, 0.6)}
    text = material("m", THIN_AIR | mist) + ball(1.5) + SUN
    once = means(picture(text, max_depth=1))
    assert set(once) == {"CV[LO]"}
    more = means(picture(text))
    assert set(more) == {"CV[LO]", "CV.+[LO]"}
    assert np.isclose(more["CV[LO]"], once["CV[LO]"], rtol=0.1)


def test_light_from_below_a_surface_is_diffuse() -> None:
    wax = {"base_color": (0.8, 0.6, 0.4), "subsurface_weight": 1.0, "subsurface_color": (0.8, 0.6, 0.4), "specular_weight": 0.0}
    text = material("m", wax | {"subsurface_radius": 0.3}) + ball(1.5) + SUN
    found = means(picture(text, "C<T.>.*", "CV.*"))
    assert found["C<RD>[LO]"] > 0
    assert set(found) <= {"C<RD>[LO]", "C<RD>.+[LO]"}


def test_hair_is_glossy() -> None:
    strands = "".join(f"({x / 20}, -1, 0), ({x / 20}, 1, 0.2), " for x in range(-20, 20)).removesuffix(", ")
    text = f"""
def BasisCurves "hair" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    uniform token type = "linear"
    point3f[] points = [{strands}]
    int[] curveVertexCounts = [{", ".join(["2"] * 40)}]
    float[] widths = [0.03] (interpolation = "constant")
    rel material:binding = </m>
}}
def Material "m"
{{
    bool primray:hair = true
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.5, 0.3, 0.2)
        token outputs:surface
    }}
}}
"""
    found = means(picture(text + SKY, "C<RG>.*", "C<TG>.*"))
    assert found["C<RG>.*"] > 0.01
    assert found["C<TG>.*"] > 0.01
    assert "C<RD>[LO]" not in found
    assert np.isclose(found["C[LO]"] + found["C<RG>.*"] + found["C<TG>.*"], sum(found[name] for name in NAMES if name in found))
