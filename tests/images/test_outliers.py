"""One shape that lies absurdly far away leaves the picture of all others as it is."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd

from primray import Filter, RenderSettings, render

CAMERA = """def Camera "eye"
{
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
BALL = """def Sphere "ball"
{
}
def DomeLight "sky"
{
}
"""
STATIC = """def Cube "far"
{
    double3 xformOp:translate = (%(far)s, %(far)s, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
INSTANCED = """def PointInstancer "some"
{
    rel prototypes = </some/cube>
    point3f[] positions = [(0, 3, 0), (%(far)s, 0, 0)]
    int[] protoIndices = [0, 0]
    def Cube "cube"
    {
    }
}
"""


def picture(text: str) -> np.ndarray:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString("#usda 1.0\n" + CAMERA + BALL + text)
    return render(stage, RenderSettings(resolution=(32, 32), spp=4, max_depth=1, filter=Filter.BOX)).pixels


@pytest.mark.parametrize("far", ["1e9", "1e11", "1e14", "1e19", "1e38"])
@pytest.mark.parametrize("text", [STATIC, INSTANCED], ids=["static", "instanced"])
def test_a_distant_shape(text: str, far: str) -> None:
    near = text.replace("(%(far)s, %(far)s, 0)", "(40, 40, 0)").replace("(%(far)s, 0, 0)", "(40, 0, 0)")  # out of view
    expected = picture(near)
    assert expected[16, 16, :3] == pytest.approx(0.18, rel=0.05)
    # One of 4,096 samples may meet an edge that it missed: the instances' own coordinates are rounded otherwise.
    changed = np.abs(picture(text % {"far": far}) - expected).max(axis=-1) > 0.01
    assert changed.sum() <= 1
