"""--default-wrap: of textures whose wrap neither the stage nor the file names, and of no others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray

OUTSIDE = """#usda 1.0
def Camera "c"
{
    double3 xformOp:translate = (0.5, 0.5, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "plate" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:st = [(2, 1), (3, 1), (3, 2), (2, 2)] (interpolation = "vertex")
    rel material:binding = </m>
}
def Material "m"
{
    token outputs:surface.connect = </m/surface.outputs:surface>
    def Shader "surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor.connect = </m/image.outputs:rgb>
        float inputs:roughness = 1
        int inputs:useSpecularWorkflow = 1
        color3f inputs:specularColor = (0, 0, 0)
        token outputs:surface
    }
    def Shader "image"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @image.exr@
        float2 inputs:st.connect = </m/st.outputs:result>
        %s
        float3 outputs:rgb
    }
    def Shader "st"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
"""
LOW, HIGH = 0.25, 1.0  # of the image's left and right half


def picture(folder: Path, wraps: str = "", says: str = "", **settings: Any) -> tuple[Any, set[str]]:
    """Red of the plate's left and right half, and the warnings."""
    spec = oiio.ImageSpec(8, 1, 3, oiio.FLOAT)
    if says:
        spec.attribute("wrapmodes", says)
    image = oiio.ImageBuf(spec)
    image.set_pixels(oiio.ROI(), np.repeat(np.repeat([LOW, HIGH], 4)[None, :, None], 3, axis=2).astype(np.float32))
    image.write(str(folder / "image.exr"))
    (folder / "shot.usda").write_text(OUTSIDE % wraps)
    shown = primray.render(folder / "shot.usda", resolution=(40, 30), spp=4, max_depth=1, **settings)
    lit = shown.pixels[15, :, 0][shown.pixels[15, :, 3] == 1]
    warned = {d["code"] for d in shown.report["diagnostics"] if d["severity"] == "warning"}
    return (lit[len(lit) // 4], lit[3 * len(lit) // 4]), warned


@pytest.mark.filterwarnings("ignore::primray.RenderWarning")
@pytest.mark.parametrize(
    ("wraps", "says", "asked", "shows"),
    [
        ("", "", "black", (0, 0)),
        ("", "", "clamp", (HIGH, HIGH)),
        ("", "", "repeat", (LOW, HIGH)),
        ("", "black,black", "repeat", (0, 0)),  # the file says so
        ("", "clamp,clamp", "repeat", (HIGH, HIGH)),
        ('token inputs:wrapS = "black"', "", "repeat", (0, 0)),  # the stage says so
        ('token inputs:wrapS = "repeat"', "", "clamp", (LOW, HIGH)),
        ('token inputs:wrapS = "useMetadata"', "", "mirror", (LOW, HIGH)),
    ],
)
def test_what_shows(wraps: str, says: str, asked: str, shows: tuple[float, float], tmp_path: Path) -> None:
    found, warned = picture(tmp_path, wraps, says, default_wrap=asked)
    assert found == pytest.approx(shows, abs=0.1)
    assert ("texture-outside" in warned) == (shows == (0, 0))
