"""Commits that change what a stage reads besides its own layers: clips, UDIM tiles, volumes, MaterialX documents, packages."""

from __future__ import annotations

from pathlib import Path

from pxr import UsdUtils
from tests import vdb_writer
from tests.unit.usd.volumes.volume_text import grid

from .commits import Commit, paint

CAMERA = """
def Camera "cam"
{
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky"
{
    float inputs:intensity = 1
}
"""
HEAD = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n' + CAMERA
QUAD = """
def Mesh "quad" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, -1, 0), (2, -1, 0), (2, 1, 0), (-2, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (2, 0), (2, 1), (0, 1)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
    rel material:binding = </M>
}
"""

CLIPPED = (
    HEAD
    + """
def Sphere "ball" (
    clips = {
        dictionary default = {
            double2[] active = [(0, 0)]
            asset[] assetPaths = [@./clip.usda@]
            asset manifestAssetPath = @./manifest.usda@
            string primPath = "/ball"
            double2[] times = [(0, 0), (10, 10)]
        }
    }
)
{
    double radius = 0.5
    double3 xformOp:translate
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
)
MANIFEST = '#usda 1.0\nover "ball"\n{\n    double3 xformOp:translate\n}\n'


def _clip(folder: Path, first: float, last: float = 1) -> None:
    samples = f"{{ 0: ({first}, 0, 0), 10: ({last}, 0, 0) }}"
    text = f'#usda 1.0\nover "ball"\n{{\n    double3 xformOp:translate.timeSamples = {samples}\n}}\n'
    (folder / "clip.usda").write_text(text)


def _clips(folder: Path) -> None:
    (folder / "clipped.usda").write_text(CLIPPED)
    (folder / "manifest.usda").write_text(MANIFEST)
    _clip(folder, -1)


TILED = (
    HEAD
    + QUAD
    + """
def Material "M"
{
    token outputs:surface.connect = </M/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/t.outputs:rgb>
        token outputs:surface
    }
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./tile.<UDIM>.png@
        float2 inputs:st.connect = </M/r.outputs:result>
        float3 outputs:rgb
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
"""
)


def _tiles(folder: Path) -> None:
    (folder / "tiled.usda").write_text(TILED)
    for tile in (1001, 1002):
        paint(folder / f"tile.{tile}.png", 180)


SMOKY = (
    HEAD
    + """
def Volume "Smoke"
{
    rel field:density = </Smoke/density>
    float3 xformOp:scale = (0.3, 0.3, 0.3)
    uniform token[] xformOpOrder = ["xformOp:scale"]
    def OpenVDBAsset "density"
    {
        asset filePath = @./smoke.vdb@
        token fieldName = "density"
    }
}
"""
)


def _smoke(folder: Path, density: float) -> None:
    (folder / "smoke.vdb").write_bytes(vdb_writer.vdb_bytes([grid(density)]))


def _volumes(folder: Path) -> None:
    (folder / "smoky.usda").write_text(SMOKY)
    _smoke(folder, 0.2)


LOOK = """<?xml version="1.0"?>
<materialx version="1.39">
  <open_pbr_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" value="COLOR"/>
  </open_pbr_surface>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S"/>
  </surfacematerial>
</materialx>
"""


def _look(folder: Path, color: str) -> None:
    (folder / "look.mtlx").write_text(LOOK.replace("COLOR", color))


def _documents(folder: Path) -> None:
    look = 'def Material "M" (\n    references = @./look.mtlx@</MaterialX/Materials/M>\n)\n{\n}\n'
    (folder / "worn.usda").write_text(HEAD + QUAD + look)
    _look(folder, "0.8, 0.1, 0.1")


def _pack(folder: Path, radius: float) -> None:
    inner = folder.parent / "inner.usda"
    inner.write_text(f'#usda 1.0\n(\n    defaultPrim = "ball"\n)\ndef Sphere "ball"\n{{\n    double radius = {radius}\n}}\n')
    (folder / "ball.usdz").unlink(missing_ok=True)
    assert UsdUtils.CreateNewUsdzPackage(str(inner), str(folder / "ball.usdz"))


def _packages(folder: Path) -> None:
    (folder / "packed.usda").write_text(HEAD + 'def "ball" (\n    references = @./ball.usdz@\n)\n{\n}\n')
    _pack(folder, 1)


def _measure(folder: Path) -> None:
    path = folder / "measured.usda"
    path.write_text(path.read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.01"))


MEASURED = (
    HEAD
    + """
def Sphere "ball"
{
}
def SphereLight "lamp"
{
    float photometric:power = 1000
    double3 xformOp:translate = (3, 3, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
)


def _measured(folder: Path) -> None:
    (folder / "measured.usda").write_text(MEASURED)


def changed(stage: str, verdict: str = "changed") -> dict[str, str]:
    return {stage: verdict}


KINDS = (
    Commit(
        "clip", lambda f: _clip(f, -0.4), 1, changed("clipped.usda"), ("/ball.xformOp:translate [timeSamples]",), before=_clips
    ),
    Commit(
        "clip deleted",
        lambda f: (f / "clip.usda").unlink(),
        1,
        changed("clipped.usda"),
        ("clip.usda (deleted)",),
        before=_clips,
    ),
    Commit("UDIM tile", lambda f: paint(f / "tile.1002.png", 30), 1, changed("tiled.usda"), ("tile.1002.png",), before=_tiles),
    Commit(
        "UDIM tile without use", lambda f: paint(f / "tile.1011.png", 30), 0, changed("tiled.usda", "identical"), before=_tiles
    ),
    Commit("volume", lambda f: _smoke(f, 2), 1, changed("smoky.usda"), ("smoke.vdb",), before=_volumes),
    Commit("MaterialX", lambda f: _look(f, "0.1, 0.8, 0.1"), 1, changed("worn.usda"), ("look.mtlx",), before=_documents),
    Commit("package", lambda f: _pack(f, 0.6), 1, changed("packed.usda"), ("ball.usdz",), before=_packages),
    Commit("metres in a unit", _measure, 1, changed("measured.usda"), ("/ [metersPerUnit]",), before=_measured),
)
