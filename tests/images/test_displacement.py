"""Pictures of displaced meshes: where they are seen, that nothing shines through, and what a kept scene makes of edits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Sdf, Usd
from tests.displaced import CUBE, POSITION, QUADS, materialx, node, preview

import primray
from primray.images.image import Image
from primray.settings import RenderSettings

DOME = 'def DomeLight "sky" {\n}\n'
# From z = 10, down to a square from (0, 0) to (2, 2).
ABOVE = """def Camera "above" {
    token projection = "orthographic"
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (1, 1, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
INSIDE = """def Camera "inside" {
    float focalLength = 8
    float horizontalAperture = 24
    float verticalAperture = 24
    float2 clippingRange = (0.001, 100)
    float3 xformOp:rotateXYZ = TURN
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""


def stage_of(text: str) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(f'#usda 1.0\n(\n    upAxis = "Y"\n)\n{text.replace("BODY", "")}')
    return stage


def picture(text: str, *aovs: str, size: int = 64, spp: int = 4) -> Image:
    return primray.render(stage_of(text), RenderSettings(resolution=(size, size), spp=spp, aovs=aovs))


def heights(image: Image) -> np.ndarray:
    """By pixel, from the lower left one."""
    return 10 - image.aovs["depth"].values[::-1, :, 0].astype(np.float64)


@pytest.mark.conforms("UsdPreviewSurface.inputs:displacement", "UsdPreviewSurface.outputs:displacement")
@pytest.mark.parametrize("scheme", ["none", "bilinear"])
def test_a_texture_is_a_relief(scheme: str, tmp_path: Path) -> None:
    """8 x 8 texels of random heights, bilinear between them, in the units of the mesh, which is scaled."""
    texels = np.random.default_rng(5).random((8, 8)).astype(np.float32)
    oiio.ImageBuf(np.ascontiguousarray(texels[::-1, :, None])).write(str(tmp_path / "h.exr"), "float")
    nodes = node(
        "t",
        "UsdUVTexture",
        f'asset inputs:file = @{tmp_path / "h.exr"}@\n token inputs:sourceColorSpace = "raw"\n'
        " float4 inputs:scale = (0.5, 1, 1, 1)\n"
        ' token inputs:wrapS = "clamp"\n token inputs:wrapT = "clamp"\n float2 inputs:st.connect = </m/st.outputs:result>',
        "float outputs:r",
    ) + node("st", "UsdPrimvarReader_float2", 'string inputs:varname = "st"', "float2 outputs:result")
    deeper = 'float3 xformOp:scale = (1, 1, 3)\n uniform token[] xformOpOrder = ["xformOp:scale"]'
    text = QUADS.replace("SCHEME", scheme).replace("BODY", deeper)
    image = picture(
        ABOVE + DOME + text + preview("float inputs:displacement.connect = </m/t.outputs:r>", nodes), "depth", size=128
    )
    at = np.clip((np.arange(128) + 0.5) / 128 * 8 - 0.5, 0, 7)
    low, part = np.minimum(at.astype(int), 6), at - np.minimum(at.astype(int), 6)
    rows = texels[low] * (1 - part)[:, None] + texels[low + 1] * part[:, None]
    wanted = 1.5 * (rows[:, low] * (1 - part) + rows[:, low + 1] * part)
    off = np.abs(heights(image) - wanted)
    assert np.quantile(off, 0.9) < 0.01
    assert off.max() < 0.08  # at creases between texels, within a vertex of them


def test_tiles(tmp_path: Path) -> None:
    """Of a set, each with a height of its own; where there is none, the fallback."""
    for tile, height in ((1001, 0.25), (1002, 0.5), (1012, 0.75)):
        oiio.ImageBuf(np.full((4, 4, 1), height, np.float32)).write(str(tmp_path / f"h.{tile}.exr"), "float")
    nodes = node(
        "t",
        "UsdUVTexture",
        f'asset inputs:file = @{tmp_path / "h.<UDIM>.exr"}@\n token inputs:sourceColorSpace = "raw"\n'
        " float4 inputs:fallback = (2, 2, 2, 1)\n float2 inputs:st.connect = </m/st.outputs:result>",
        "float outputs:r",
    ) + node("st", "UsdPrimvarReader_float2", 'string inputs:varname = "wide"', "float2 outputs:result")
    wide = """texCoord2f[] primvars:wide = [(0,0), (1,0), (2,0), (0,1), (1,1), (2,1), (0,2), (1,2), (2,2)] (
        interpolation = "vertex"
    )"""
    text = QUADS.replace("SCHEME", "none").replace("BODY", wide)
    material = preview("float inputs:displacement.connect = </m/t.outputs:r>", nodes)
    found = heights(picture(ABOVE + DOME + text + material, "depth"))
    for row, column, height in ((16, 16, 0.25), (16, 48, 0.5), (48, 48, 0.75), (48, 16, 2)):
        np.testing.assert_allclose(found[row - 8 : row + 8, column - 8 : column + 8], height, atol=1e-5)


def test_a_document(tmp_path: Path) -> None:
    """MaterialX, by a graph that is no single texture: the higher one of an image and a ramp."""
    texels = np.zeros((4, 4, 1), np.float32)
    texels[:, 2:] = 0.75
    oiio.ImageBuf(texels).write(str(tmp_path / "h.exr"), "float")
    (tmp_path / "look.mtlx").write_text("""<?xml version="1.0"?>
<materialx version="1.39">
  <nodegraph name="g">
    <image name="i" type="float"><input name="file" type="filename" value="h.exr"/></image>
    <texcoord name="st" type="vector2"/>
    <extract name="t" type="float">
      <input name="in" type="vector2" nodename="st"/><input name="index" type="integer" value="1"/>
    </extract>
    <max name="m" type="float"><input name="in1" type="float" nodename="i"/><input name="in2" type="float" nodename="t"/></max>
    <output name="out" type="float" nodename="m"/>
  </nodegraph>
  <standard_surface name="s" type="surfaceshader"/>
  <displacement name="d" type="displacementshader">
    <input name="displacement" type="float" nodegraph="g" output="out"/><input name="scale" type="float" value="2"/>
  </displacement>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="s"/>
    <input name="displacementshader" type="displacementshader" nodename="d"/>
  </surfacematerial>
</materialx>
""")
    mesh = QUADS.replace("SCHEME", "none").replace("BODY", "").replace("</m>", "</look/Materials/M>")
    look = 'def "look" (\n references = @./look.mtlx@</MaterialX>\n) {\n}\n'
    (tmp_path / "stage.usda").write_text(f'#usda 1.0\n(\n upAxis = "Y"\n)\n{ABOVE}{DOME}{look}{mesh}')
    settings = RenderSettings(resolution=(64, 64), spp=4, aovs=("depth",))
    found = heights(primray.render(tmp_path / "stage.usda", settings))
    t = (np.arange(64) + 0.5) / 64
    np.testing.assert_allclose(found[:, 12:20], np.broadcast_to(2 * t[:, None], (64, 8)), atol=0.02)
    np.testing.assert_allclose(found[:, 44:52], np.broadcast_to(np.maximum(1.5, 2 * t)[:, None], (64, 8)), atol=0.03)


def test_what_glows_and_moves() -> None:
    """Displaced meshes give light as any others, and are blurred as they go."""
    glow = preview("float inputs:displacement = 0.5\n color3f inputs:emissiveColor = (2, 2, 2)")
    still = ABOVE + QUADS.replace("SCHEME", "none") + glow
    image = picture(still, "depth", size=32)
    np.testing.assert_allclose(image.pixels[..., :3], 2, rtol=1e-5)
    moves = """double3 xformOp:translate.timeSamples = {
        0: (0, 0, 0),
        1: (0, 0, 2),
    }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    """
    shutter = ABOVE.replace("token projection", "double shutter:open = 0\n double shutter:close = 1\n token projection")
    moving = shutter + QUADS.replace("SCHEME", "none").replace("BODY", moves) + glow
    settings = RenderSettings(resolution=(32, 32), spp=4, aovs=("depth",), time_code=0.0)
    image = primray.render(stage_of(moving), settings)
    assert image.report["motion"]["moving"]
    assert image.pixels[..., 3].min() == 1


NOISE = POSITION + node(
    "n", "ND_noise3d_float", "float3 inputs:position.connect = </NAME/big.outputs:out>", "float outputs:out"
)
NOISE += node(
    "big",
    "ND_multiply_vector3FA",
    "float3 inputs:in1.connect = </NAME/p.outputs:out>\n float inputs:in2 = 5",
    "float3 outputs:out",
)


def noisy(name: str, scale: float) -> str:
    return materialx(
        f"float inputs:displacement.connect = </{name}/n.outputs:out>\n float inputs:scale = {scale}",
        NOISE.replace("NAME", name),
        name=name,
    )


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
@pytest.mark.parametrize("turn", [(0, 0, 0), (35, 45, 0)])
def test_no_sky_in_a_closed_cube(scheme: str, turn: tuple[int, int, int]) -> None:
    """White all around, and black inside: with seams, sharp edges and a material a face."""
    parts = "".join(
        f"""def GeomSubset "s{k}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [{k}]
            rel material:binding = </m{k}>
        }}
        """
        for k in range(5)
    )
    materials = noisy("m", 0.3) + "".join(noisy(f"m{k}", 0.1 * k) for k in range(4)) + preview("", name="m4")
    text = INSIDE.replace("TURN", str(turn)) + DOME + CUBE.replace("SCHEME", scheme).replace("BODY", parts) + materials
    image = picture(text, "depth", size=96, spp=16)
    assert (image.pixels[..., 3] == 1).all()
    assert (image.pixels[..., :3] == 0).all()
    assert image.report["scene"]["triangles_unique"] > 5000


def test_instances_have_the_shape_of_a_mesh() -> None:
    """Two of them beside each other, and turned; all of it as where meshes of their own stand."""
    mesh = QUADS.replace("SCHEME", "catmullClark").replace("</m>", "</proto/m>").replace("BODY", "")
    inside = mesh + noisy("m", 0.4).replace("</m/", "</proto/m/")
    places = [
        f"double3 xformOp:translate = ({k}, {k}, 0)\n double3 xformOp:scale = (0.5, 0.5, 0.5)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]'
        for k in (0, 1)
    ]

    def scene(instanceable: str) -> str:
        copies = "".join(
            f'def Xform "i{k}" (\n instanceable = {instanceable}\n prepend references = </proto>\n) {{\n {place}\n}}\n'
            for k, place in enumerate(places)
        )
        return ABOVE + DOME + f'class Xform "proto" {{\n{inside}\n}}\n' + copies

    instances, meshes = (picture(scene(kind), "depth").aovs["depth"].values for kind in ("true", "false"))
    there = np.isfinite(meshes)
    assert there.sum() > 1500
    assert np.array_equal(there, np.isfinite(instances))
    np.testing.assert_allclose(instances[there], meshes[there], atol=2e-3)


def test_bounds_hold_what_is_displaced() -> None:
    """Far out of the mesh's own box, and seen by a ray that misses it."""
    image = picture(ABOVE + DOME + QUADS.replace("SCHEME", "none") + preview("float inputs:displacement = 7"), "depth", size=32)
    np.testing.assert_allclose(heights(image), 7, atol=1e-5)


def test_a_kept_scene_displaces_again() -> None:
    stage = stage_of(ABOVE + DOME + QUADS.replace("SCHEME", "none") + preview("float inputs:displacement = 1"))
    settings = RenderSettings(resolution=(32, 32), spp=1, aovs=("depth",))
    scene = primray.Scene(stage)
    np.testing.assert_allclose(heights(scene.render(settings)), 1, atol=1e-5)
    stage.GetPrimAtPath("/m/s").GetAttribute("inputs:displacement").Set(2.0)
    np.testing.assert_allclose(heights(scene.render(settings)), 2, atol=1e-5)
    stage.GetPrimAtPath("/m/s").CreateAttribute("inputs:roughness", Sdf.ValueTypeNames.Float).Set(0.25)
    again, alone = scene.render(settings), primray.render(stage, settings)
    assert np.array_equal(again.pixels, alone.pixels)


def test_the_picture_is_the_same_for_any_threads() -> None:
    text = ABOVE + DOME + QUADS.replace("SCHEME", "catmullClark") + noisy("m", 0.5)
    one, four = (
        primray.render(stage_of(text), RenderSettings(resolution=(48, 48), spp=2, threads=threads)).pixels for threads in (1, 4)
    )
    assert np.array_equal(one, four)
