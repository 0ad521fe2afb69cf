"""displayOpacity without a material: Lambert where it is there, nothing else where it is not. Closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.usd.usd_text import stage_of

from primray.settings import Filter, RenderSettings

SCENE = """
def Camera "camera"
{
    token projection = "orthographic"
    float horizontalAperture = 10
    float verticalAperture = 10
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky"
{
}
def Mesh "square"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    color3f[] primvars:displayColor = [(0.8, 0.4, 0)]
    float[] primvars:displayOpacity = [OPACITY]
}
"""


@pytest.mark.parametrize("opacity", [0.0, 0.25, 1.0])
@pytest.mark.conforms("Gprim.primvars:displayOpacity")
def test_in_a_white_sky(opacity: float) -> None:
    """In front of radiance 1 all around, a square of albedo a and opacity o shows o a + 1 - o."""
    from primray import render

    settings = RenderSettings(resolution=(16, 16), spp=256, filter=Filter.BOX)
    pixels = render(stage_of(SCENE.replace("OPACITY", str(opacity))), settings).pixels
    expected = opacity * np.array([0.8, 0.4, 0.0]) + 1 - opacity
    # 65536 samples of values between 0 and 1: a standard error of at most 0.002.
    assert np.allclose(pixels[:, :, :3].mean(axis=(0, 1)), expected, atol=0.01)
