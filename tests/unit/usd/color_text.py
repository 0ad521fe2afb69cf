"""Stages whose colours are in some space, and colours worked out from published primaries."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from tests.colorimetry import AP1, P3_D65, between, from_srgb
from tests.colorimetry import REC709 as PUBLISHED

from primray.description import SceneDescription
from primray.settings import RenderSettings

from .usd_text import translate_text

TO_AP1 = between(PUBLISHED, AP1)
FROM_AP1 = between(AP1, PUBLISHED)
RGB = (0.6, 0.3, 0.2)
IN_AP1 = RenderSettings(rendering_color_space="lin_ap1_scene")
APPLIED = '(prepend apiSchemas = ["ColorSpaceAPI"])'
AP1_HERE = 'uniform token colorSpace:name = "lin_ap1_scene"'
# A space with primaries of its own and a curve: colours of it are worked out by hand below.
DEFINED = """(prepend apiSchemas = ["ColorSpaceAPI", "ColorSpaceDefinitionAPI:ours"])
{
    uniform token colorSpace:name = "house"
    uniform token colorSpaceDefinition:ours:name = "house"
    float2 colorSpaceDefinition:ours:redChroma = (0.68, 0.32)
    float2 colorSpaceDefinition:ours:greenChroma = (0.265, 0.69)
    float2 colorSpaceDefinition:ours:blueChroma = (0.15, 0.06)
    float2 colorSpaceDefinition:ours:whitePoint = (0.3127, 0.329)
    float colorSpaceDefinition:ours:gamma = 2.4
    float colorSpaceDefinition:ours:linearBias = 0.055
"""
HOUSE = between(P3_D65, PUBLISHED) @ from_srgb(RGB)

Doubles = npt.NDArray[np.float64]


def close(found: object, expected: npt.ArrayLike) -> bool:
    return bool(np.allclose(np.asarray(found, np.float64), expected, rtol=3e-6, atol=3e-6))


def quiet(text: str, settings: RenderSettings | None = None) -> SceneDescription:
    """Translated without a word about colours."""
    description, found = translate_text(text, settings)
    assert [code for code, _ in found if code in ("color-space", "api-schema", "unknown-input")] == []
    return description


def ball(color: str, around: str = "", before: str = "") -> str:
    return f"""
def Xform "top" {before or "{"}
    {around}
    def Sphere "ball"
    {{
        color3f[] primvars:displayColor = [{RGB}] {color}
    }}
}}
"""


def lamp(body: str, around: str = "", before: str = "") -> str:
    return f'def Xform "top" {before or "{"}\n{around}\ndef SphereLight "lamp"\n{{\n{body}\n}}\n}}\n'


def shown(text: str, settings: RenderSettings | None = None) -> tuple[float, ...]:
    (surface,) = quiet(text, settings).surfaces
    return surface.diffuse_color


def emitted(text: str, settings: RenderSettings | None = None) -> tuple[float, ...]:
    (light,) = quiet(text, settings).lights
    return light.emission
