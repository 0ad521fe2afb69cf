"""How the studio light shows albedos in the default view: a chart of 24 patches and shader balls, judged by CIEDE2000."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from pxr import Usd
from tests.colorimetry import Doubles, ciede2000, from_srgb, hue_difference_deg, lab_of

import primray

DOCS = Path(__file__).parents[2] / "docs"
# X-Rite's sRGB values of the ColorChecker Classic (2005), row by row; the last row is grey, from white to black.
PATCHES = """115 82 68  194 150 130  98 122 157  87 108 67  133 128 177  103 189 170
214 126 44  80 91 166  193 90 99  94 60 108  157 188 64  224 163 46
56 61 150  70 148 73  175 54 60  231 199 31  187 86 149  8 133 161
243 243 242  200 200 200  160 160 160  122 122 121  85 85 85  52 52 52"""
ALBEDOS = from_srgb(np.array(PATCHES.split(), float).reshape(4, 6, 3) / 255)
CAMERA = """
def Camera "c"
{{
    float focalLength = 100
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, {distance})
    uniform token[] xformOpOrder = ["xformOp:translate"]
    {exposure}
}}
"""
# Published pairs of CIELAB colours and their differences (Sharma, Wu and Dalal 2005, table 1).
PUBLISHED = [
    ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
    ((50, 0, 0), (50, -1, 2), 2.3669),
    ((50, 2.5, 0), (73, 25, -18), 27.1492),
    ((50, 2.5, 0), (61, -5, 29), 22.8977),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
]


@pytest.mark.parametrize(("first", "second", "published"), PUBLISHED)
def test_the_judge(first: tuple[float, ...], second: tuple[float, ...], published: float) -> None:
    assert ciede2000(np.array(first, float), np.array(second, float)) == pytest.approx(published, abs=1e-4)


def shown(
    text: str, size: tuple[int, int], spp: int, distance: float, exposure: str = "", look: dict[str, Any] | None = None
) -> npt.NDArray[np.uint8]:
    stage = Usd.Stage.CreateInMemory()
    camera = CAMERA.format(distance=distance, exposure=exposure)
    assert stage.GetRootLayer().ImportFromString(f'#usda 1.0\n(\n    upAxis = "Y"\n)\n{camera}{text}')
    return primray.render(stage, resolution=size, spp=spp).to_uint8(**(look or {}))


def chart() -> str:
    """One mesh of 6 x 4 squares in the plane of the picture, each of one ColorChecker albedo."""
    points, colors = [], []
    for row in range(4):
        for column in range(6):
            x, y = column - 3, 1 - row
            points += [(x, y, 0), (x + 1, y, 0), (x + 1, y + 1, 0), (x, y + 1, 0)]
            colors.append(tuple(ALBEDOS[row, column].round(6).tolist()))
    return f"""
def Mesh "chart"
{{
    point3f[] points = {points}
    int[] faceVertexCounts = {[4] * 24}
    int[] faceVertexIndices = {list(range(96))}
    color3f[] primvars:displayColor = {colors} ( interpolation = "uniform" )
}}
"""


@pytest.mark.parametrize("exposure", ["", "float exposure:time = 0.001"])
def test_a_chart_shows_its_albedos(exposure: str) -> None:
    """Each patch is as near to its own albedo as the view allows, whatever the camera's exposure: grey 0.18 is mid-grey."""
    pixels = shown(chart(), (48, 48), 64, 30, exposure)[8:40, :, :3]
    patches = from_srgb(np.median(pixels.reshape(4, 8, 6, 8, 3)[:, 2:6, :, 2:6], axis=(1, 3)) / 255)
    found, wanted = lab_of(patches), lab_of(ALBEDOS)
    differences = ciede2000(found, wanted)
    assert differences.mean() < 4, differences.round(1)
    assert differences.max() < 11, differences.round(1)
    assert found[3, 3, 0] == pytest.approx(wanted[3, 3, 0], abs=2)  # the grey of 0.19
    assert (np.diff(found[3, :, 0]) < -5).all()  # white to black: every step is seen
    assert np.hypot(*np.moveaxis(found[3, :, 1:], -1, 0)).max() < 2  # greys stay grey
    assert hue_difference_deg(found, wanted)[:3].max() < 15


@pytest.mark.parametrize("exposure", ["", "float exposure:time = 0.001"])
def test_a_chart_shows_its_srgb_values_without_a_tone_curve(exposure: str) -> None:
    """The view and the stops that docs/command-line.md names bring every patch back, from black to white, to its code."""
    page = (DOCS / "command-line.md").read_text().partition("## A picture of a model")[2]
    named = re.search(r"--view (\S+) --exposure (\S+)", page)
    assert named is not None
    look = {"view": named[1], "exposure": float(named[2])}
    pixels = shown(chart(), (48, 48), 64, 30, exposure, look)[8:40, :, :3]
    patches = np.median(pixels.reshape(4, 8, 6, 8, 3)[:, 2:6, :, 2:6], axis=(1, 3))
    assert np.abs(patches - np.array(PATCHES.split(), float).reshape(4, 6, 3)).max() <= 1


BALL = """
def Sphere "ball" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    double radius = 0.95
    rel material:binding = </m>
}}
def Material "m"
{{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = {albedo}
        token outputs:surface
    }}
}}
"""
COLORS = {"red": (0.8, 0.05, 0.04), "green": (0.04, 0.6, 0.05), "blue": (0.05, 0.1, 0.8), "yellow": (0.8, 0.7, 0.05)}


def ball(albedo: tuple[float, float, float]) -> Doubles:
    """CIELAB (N, 3) of the pixels that a shiny ball of this albedo covers."""
    pixels = shown(BALL.format(albedo=albedo), (32, 32), 64, 10)
    return lab_of(from_srgb(pixels[pixels[..., 3] == 255][:, :3] / 255))


@pytest.mark.parametrize("name", COLORS)
def test_a_ball_keeps_its_hue(name: str) -> None:
    """Its brightest half is not bleached, highlight and all: chroma stays, and the hue is the albedo's."""
    found, wanted = ball(COLORS[name]), lab_of(np.array(COLORS[name]))
    bright = found[found[:, 0] >= np.median(found[:, 0])]
    assert np.median(hue_difference_deg(bright, wanted)) < 15
    assert np.median(np.hypot(bright[:, 1], bright[:, 2])) > 0.55 * np.hypot(*wanted[1:])
    assert np.median(ciede2000(bright, np.broadcast_to(wanted, bright.shape))) < 13


def test_white_keeps_form_and_black_is_black() -> None:
    white, black = ball((0.8, 0.8, 0.8))[:, 0], ball((0.02, 0.02, 0.02))[:, 0]
    assert 75 < np.percentile(white, 90) < 92  # below white
    assert np.percentile(white, 90) - np.percentile(white, 10) > 20  # and round
    assert np.median(black) < 22
