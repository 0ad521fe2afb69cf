"""Coverage falls by what is seen of nothing straight through surfaces, whatever lights them and however paths are split."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray
from primray.images.image import Image

HEAD = """#usda 1.0
def Camera "c"
{
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
PANE = """
def Mesh "pane{name}" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    point3f[] points = [(-9, -9, {z}), (9, -9, {z}), (9, 9, {z}), (-9, 9, {z})]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    rel material:binding = </pane{name}/m>
    def Material "m"
    {{
        token outputs:surface.connect = </pane{name}/m/s.outputs:surface>
        def Shader "s"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.5, 0.5, 0.5)
            float inputs:roughness = 0.4
            float inputs:ior = {ior}
            float inputs:opacity = {opacity}
            token inputs:opacityMode = "{mode}"
            token outputs:surface
        }}
    }}
}}
"""
DOME = 'def DomeLight "sky"\n{\n}\n'
HIDDEN = 'def DomeLight "sky"\n{\n    bool primvars:arnold:camera = 0\n    custom bool inputs:visibility:camera = 0\n}\n'
SUN = 'def DistantLight "sun"\n{\n    float inputs:intensity = 3\n    float inputs:angle = 1\n}\n'


def panes(*opacities: float, mode: str = "presence", ior: float = 1.5) -> str:
    return "".join(PANE.format(name=k, z=-k, opacity=o, mode=mode, ior=ior) for k, o in enumerate(opacities))


def shot(text: str, **settings: Any) -> Image:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(HEAD + text)
    return primray.render(stage, **{"resolution": (16, 12), "spp": 256, **settings})


def alpha(text: str, **settings: Any) -> float:
    return float(shot(text, **settings).pixels[..., 3].astype(np.float64).mean())


@pytest.mark.parametrize("light", [SUN, HIDDEN, ""])  # without one: the default light
@pytest.mark.parametrize(
    ("scene", "covered"),
    [
        (panes(0.25), 0.25),
        (panes(0.5, 0.5), 0.75),
        (panes(0.25, 1), 1),
        (panes(0), 0),
        (panes(0.25, mode="transparent", ior=1), 0.25),
        (panes(0.5, 0.5, mode="transparent", ior=1), 0.75),
        (panes(1, mode="transparent"), 1),
    ],
)
def test_what_covers_the_picture(scene: str, covered: float, light: str) -> None:
    assert alpha(scene + light) == pytest.approx(covered, abs=0.01)


def test_reflections_cover_too() -> None:
    """A pane of glass reflects, for which it counts; straight through comes what is left: 1 - F, F = 0.04 at normal incidence
    of an ior of 1.5 (twice, as a thin pane has two sides, or once)."""
    assert 0.03 < alpha(panes(0, mode="transparent") + SUN) < 0.09


def test_before_a_sky_that_is_seen_gaps_are_holes_and_glass_covers() -> None:
    image = shot(panes(0.25) + DOME, max_depth=1)
    assert image.pixels[..., 3].mean() == pytest.approx(0.25, abs=0.02)
    assert image.pixels[..., 0].mean() > 0.75
    assert (shot(panes(0, mode="transparent") + DOME).pixels[..., 3] == 1).all()


def test_few_samples_add_up_to_many() -> None:
    """Whole samples are covered or not; a pixel's are all counted, in parts that are merged as well."""
    few = [alpha(panes(0.3) + SUN, spp=4, seed=seed) for seed in range(32)]
    assert np.mean(few) == pytest.approx(0.3, abs=0.02)


def test_a_png_shows_what_is_behind(tmp_path: Any) -> None:
    shown = shot(panes(0.25) + SUN).to_uint8()
    assert shown[..., 3].mean() == pytest.approx(0.25 * 255, abs=4)
