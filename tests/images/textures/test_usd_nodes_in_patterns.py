"""USD's own nodes give the same in a pattern as where they are a texture by themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray.arrays import Floats

STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "cam"
{
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 30
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "quad" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, -1.5, 0), (2, -1.5, 0), (2, 1.5, 0), (-2, 1.5, 0)]
    texCoord2f[] primvars:st = [(-0.5, -0.5), (1.5, -0.5), (1.5, 1.5), (-0.5, 1.5)] (
        interpolation = "vertex"
    )
}
def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:out>
    def Shader "s"
    {
        uniform token info:id = "ND_surface_unlit"
        color3f inputs:emission_color.connect = </m/t.outputs:OUTPUT>
        token outputs:out
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
    def Shader "x"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </m/BEFORE>
        float2 inputs:scale = (1.5, 1.25)
        float inputs:rotation = 30
        float2 inputs:translation = (0.125, 0.25)
        float2 outputs:result
    }
    def Shader "same"
    {
        uniform token info:id = "ND_max_vector2FA"
        float2 inputs:in1.connect = </m/r.outputs:result>
        float inputs:in2 = -100
        float2 outputs:out
    }
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./FILE@
        token inputs:sourceColorSpace = "raw"
        float2 inputs:st.connect = </m/x.outputs:result>
        token inputs:wrapS = "WRAP"
        token inputs:wrapT = "WRAP"
        float4 inputs:fallback = (0.125, 0.5, 0.25, 0.75)
        float4 inputs:scale = (0.5, 0.75, 1, 0.5)
        float4 inputs:bias = (0.25, 0.125, 0, 0.0625)
        float3 outputs:OUTPUT
    }
}
"""
TEXELS = np.random.default_rng(5).uniform(0.1, 0.9, (4, 4, 4)).astype(np.float32)


def rendered(folder: Path, before: str, output: str, wrap: str, file: str) -> Floats:
    text = STAGE.replace("BEFORE", before).replace("OUTPUT", output).replace("WRAP", wrap).replace("FILE", file)
    path = folder / "a.usda"
    path.write_text(text)
    return primray.render(path, resolution=(24, 18), spp=4, seed=3).pixels[..., :3]


@pytest.mark.parametrize("wrap", ["black", "clamp", "repeat", "mirror", "useMetadata"])
@pytest.mark.parametrize("output", ["rgb", "a"])
@pytest.mark.parametrize("file", ["t.exr", "broken.exr", "t.<UDIM>.exr"])
def test_a_pattern_of_a_texture_is_the_texture(file: str, output: str, wrap: str, tmp_path: Path) -> None:
    for name in ("t.exr", "t.1001.exr"):
        oiio.ImageBuf(TEXELS).write(str(tmp_path / name), "float")
    (tmp_path / "broken.exr").write_bytes(b"no picture")
    alone = rendered(tmp_path, "r.outputs:result", output, wrap, file)
    in_pattern = rendered(tmp_path, "same.outputs:out", output, wrap, file)
    np.testing.assert_allclose(in_pattern, alone, atol=2e-3)
    assert alone.std() > 0.01 or file == "broken.exr"
