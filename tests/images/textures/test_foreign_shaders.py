"""Materials that carry only another renderer's shaders look as the same materials said in MaterialX."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray

STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "c"
{
    float focalLength = 40
    float horizontalAperture = 20
    float verticalAperture = 15
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DistantLight "l"
{
    float inputs:intensity = 3
    bool inputs:normalize = 1
    float3 xformOp:rotateXYZ = (-30, 20, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
def Mesh "plane" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    color3f[] primvars:displayColor = [(0, 1, 1)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
    color3f[] primvars:tint = [(1, 0.5, 0.25), (1, 1, 1), (0.25, 0.5, 1), (0.5, 1, 0.5)] (interpolation = "vertex")
}
def Material "m"
{
    token outputs:CONTEXT.connect = </m/s.outputs:out>
    NODES
}
"""


def node(name: str, identifier: str, inputs: str, output: str = "token outputs:out") -> str:
    return f'def Shader "{name}" {{\n uniform token info:id = "{identifier}"\n {inputs}\n {output}\n}}\n'


ARNOLD = (
    node(
        "s",
        "arnold:standard_surface",
        "color3f inputs:base_color.connect = </m/times.outputs:out>\n float inputs:specular_roughness.connect = "
        "</m/rough.outputs:r>\n vector3f inputs:normal.connect = </m/normal.outputs:out>",
    )
    + node("times", "arnold:multiply", "color3f inputs:input1.connect = </m/image.outputs:out>\n"
           "color3f inputs:input2.connect = </m/data.outputs:rgb>")
    + node("image", "arnold:image", "asset inputs:filename = @color.png@\n float inputs:sscale = 2\n"
           "string inputs:swrap = \"mirror\"\n color3f inputs:multiply = (0.5, 1, 1)")
    + node("data", "arnold:user_data_rgb", 'string inputs:attribute = "tint"', "color3f outputs:rgb")
    + node("rough", "arnold:image", 'asset inputs:filename = @color.png@\n string inputs:color_space = "raw"',
           "float outputs:r")
    + node("normal", "arnold:normal_map", "color3f inputs:input.connect = </m/bumps.outputs:out>")
    + node("bumps", "arnold:image", 'asset inputs:filename = @normal.png@\n string inputs:color_space = "raw"')
)  # fmt: skip
FILE = 'asset inputs:file = @%s@ (colorSpace = "%s")\n'
MATERIALX = (
    node(
        "s",
        "ND_standard_surface_surfaceshader",
        "color3f inputs:base_color.connect = </m/times.outputs:out>\n float inputs:specular_roughness.connect = "
        "</m/rough.outputs:out>\n float3 inputs:normal.connect = </m/normal.outputs:out>",
    )
    + node("times", "ND_multiply_color3", "color3f inputs:in1.connect = </m/half.outputs:out>\n"
           "color3f inputs:in2.connect = </m/data.outputs:out>")
    + node("half", "ND_multiply_color3", "color3f inputs:in1.connect = </m/image.outputs:out>\n"
           "color3f inputs:in2 = (0.5, 1, 1)")
    + node("image", "ND_image_color3", FILE % ("color.png", "srgb_rec709_scene")
           + 'float2 inputs:texcoord.connect = </m/twice.outputs:out>\n string inputs:uaddressmode = "mirror"')
    + node("twice", "ND_multiply_vector2", "float2 inputs:in1.connect = </m/st.outputs:out>\n float2 inputs:in2 = (2, 1)")
    + node("st", "ND_texcoord_vector2", "")
    + node("data", "ND_geompropvalue_color3", 'string inputs:geomprop = "tint"')
    + node("rough", "ND_image_float", FILE % ("color.png", "raw"))
    + node("normal", "ND_normalmap_float", "float3 inputs:in.connect = </m/bumps.outputs:out>")
    + node("bumps", "ND_image_vector3", FILE % ("normal.png", "raw"))
)  # fmt: skip
RENDERMAN = (
    node("s", "PxrDiffuse", "color3f inputs:diffuseColor.connect = </m/image.outputs:resultRGB>\n"
         "normal3f inputs:bumpNormal.connect = </m/bumps.outputs:resultN>")
    + node("image", "PxrTexture", "asset inputs:filename = @color.png@\n int inputs:linearize = 1", "color3f outputs:resultRGB")
    + node("bumps", "PxrNormalMap", "asset inputs:filename = @normal.png@", "normal3f outputs:resultN")
)  # fmt: skip
HOUDINI = node(
    "s",
    "principledshader::2.0",
    "asset inputs:basecolor_texture = @color.png@\n int inputs:basecolor_useTexture = 1\n float3 inputs:basecolor = (1, 1, 1)\n"
    "int inputs:basecolor_usePointColor = 0\n float inputs:metallic = 1\n float inputs:rough = 1",
)
DIFFUSE = (
    node("s", "ND_open_pbr_surface_surfaceshader", "float inputs:specular_weight = 0\n"
         "color3f inputs:base_color.connect = </m/image.outputs:out>\n float3 inputs:geometry_normal.connect = "
         "</m/normal.outputs:out>")
    + node("image", "ND_image_color3", FILE % ("color.png", "srgb_rec709_scene"))
    + node("normal", "ND_normalmap_float", "float3 inputs:in.connect = </m/bumps.outputs:out>")
    + node("bumps", "ND_image_vector3", FILE % ("normal.png", "raw"))
)  # fmt: skip
METAL = node(
    "s",
    "ND_open_pbr_surface_surfaceshader",
    "color3f inputs:base_color.connect = </m/image.outputs:out>\n float inputs:base_metalness = 1\n"
    "float inputs:specular_roughness = 1",
) + node("image", "ND_image_color3", FILE % ("color.png", "srgb_rec709_scene"))
PAIRS = {
    "Arnold": ("arnold:surface", ARNOLD, MATERIALX),
    "RenderMan": ("ri:surface", RENDERMAN, DIFFUSE),
    "Houdini": ("karma:surface", HOUDINI, METAL),
}


def picture(folder: Path, context: str, nodes: str, **settings: Any) -> Any:
    path = folder / "stage.usda"
    path.write_text(STAGE.replace("CONTEXT", context).replace("NODES", nodes))
    return primray.render(path, resolution=(64, 48), spp=4, max_depth=2, progress=False, **settings).values


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(5)
    colors = rng.uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32)
    normals = np.concatenate([rng.uniform(0.3, 0.7, (8, 8, 2)), np.full((8, 8, 1), 0.95)], axis=2).astype(np.float32)
    for name, pixels in (("color.png", colors), ("normal.png", normals)):
        file = oiio.ImageOutput.create(str(tmp_path / name))
        assert file is not None
        file.open(str(tmp_path / name), oiio.ImageSpec(8, 8, 3, "uint8"))
        file.write_image(np.ascontiguousarray(pixels))
        file.close()
    return tmp_path


@pytest.mark.filterwarnings("ignore::primray.RenderWarning")
@pytest.mark.parametrize(("context", "foreign", "own"), PAIRS.values(), ids=PAIRS)
def test_a_translated_material_looks_as_the_same_in_materialx(context: str, foreign: str, own: str, folder: Path) -> None:
    translated = picture(folder, context, foreign)
    expected = picture(folder, "mtlx:surface", own)
    np.testing.assert_allclose(translated, expected, rtol=1e-5, atol=1e-6)
    assert np.ptp(translated[16:32, 24:40, :3], axis=(0, 1)).min() > 0.05  # its textures are seen


@pytest.mark.filterwarnings("ignore::primray.RenderWarning")
def test_untranslated_shaders_show_the_display_color(folder: Path) -> None:
    shown = picture(folder, "arnold:surface", ARNOLD, translated_shaders=False)
    middle = shown[20:28, 28:36, :3].mean(axis=(0, 1))
    assert middle[0] == 0
    assert middle[1] > 0.1
    assert middle[2] > 0.1
