"""A git repository with a small shot, and commits whose effect on its pictures is known."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from primray.images.image import write_png

SHOT = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    subLayers = [@./lights.usda@]
)

def Xform "World"
{
    def Camera "cam"
    {
        float2 clippingRange = (0.1, 100)
        double3 xformOp:translate = (0, 0, 8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def "left" (
        references = @./asset.usda@
    )
    {
        double3 xformOp:translate = (-1.2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def "right" (
        references = @./asset.usda@
        variants = {
            string size = "small"
        }
    )
    {
        double3 xformOp:translate = (1.2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Sphere "mover"
    {
        double radius = 0.2
        color3f[] primvars:displayColor = [(0.2, 0.7, 0.2)]
        double3 xformOp:translate.timeSamples = { 1: (0, 1, 0), 10: (0, -1, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def "prop" (
        references = @./late.usda@
    )
    {
        double3 xformOp:translate = (0, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""
LIGHTS = """#usda 1.0
over "World"
{
    def DistantLight "key"
    {
        bool inputs:normalize = true
        float inputs:intensity = 3
    }
}
"""
ASSET = """#usda 1.0
(
    defaultPrim = "Asset"
)
def Xform "Asset" (
    variants = {
        string size = "big"
    }
    prepend variantSets = "size"
)
{
    def Mesh "card" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-0.8, -0.8, 0), (0.8, -0.8, 0), (0.8, 0.8, 0), (-0.8, 0.8, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
            interpolation = "vertex"
        )
        uniform token subdivisionScheme = "none"
        rel material:binding = </Asset/M>
    }
    def Material "M"
    {
        token outputs:surface.connect = </Asset/M/s.outputs:surface>
        def Shader "s"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </Asset/M/t.outputs:rgb>
            float inputs:roughness = 0.6
            token outputs:surface
        }
        def Shader "t"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./paint.png@
            float2 inputs:st.connect = </Asset/M/r.outputs:result>
            float3 outputs:rgb
        }
        def Shader "r"
        {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }
    variantSet "size" = {
        "big" {
            over "card"
            {
                float3 xformOp:scale = (1, 1, 1)
                uniform token[] xformOpOrder = ["xformOp:scale"]
            }
        }
        "small" {
            over "card"
            {
                float3 xformOp:scale = (0.5, 0.5, 0.5)
                uniform token[] xformOpOrder = ["xformOp:scale"]
            }
        }
        "unused" {
            over "card"
            {
                float3 xformOp:scale = (2, 2, 2)
                uniform token[] xformOpOrder = ["xformOp:scale"]
            }
        }
    }
}
"""
LATE = """#usda 1.0
(
    defaultPrim = "Late"
)
def Sphere "Late"
{
    double radius = 0.3
}
"""
OTHER = """#usda 1.0
def Sphere "ball"
{
    color3f[] primvars:displayColor = [(0.8, 0.1, 0.1)]
}
"""
POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:" + "0" * 64 + "\nsize 1234\n"
KEY, SHADER, LEFT = "/World/key.inputs:intensity", "/Asset/M/s.inputs:roughness", "/World/left.xformOp:translate"


def git(folder: Path, *words: str) -> str:
    identity = ["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"]
    return subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


def paint(path: Path, shade: int) -> None:
    pixels = np.full((8, 8, 3), shade, np.uint8)
    pixels[:4, :4] = (200, 60, 40)
    write_png(pixels, path)


def make_repository(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (("shot", SHOT), ("lights", LIGHTS), ("asset", ASSET), ("other", OTHER)):
        (folder / f"{name}.usda").write_text(text)
    paint(folder / "paint.png", 180)
    (folder / "README").write_text("a shot\n")
    git(folder, "init", "--quiet", "--initial-branch", "main")
    commit(folder, "first")


def commit(folder: Path, message: str) -> None:
    git(folder, "add", "--all")
    git(folder, "commit", "--quiet", "--allow-empty", "--message", message)


def replace(folder: Path, name: str, *pairs: tuple[str, str]) -> None:
    path = folder / f"{name}.usda"
    text = path.read_text()
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    path.write_text(text)


@dataclass(frozen=True)
class Commit:
    """`verdicts`: of each stage that must be touched; `moves`: edits that must move pixels, `still`: those that must not;
    `before`: what the commit before adds to the repository."""

    name: str
    change: Callable[[Path], object]
    exit_code: int
    verdicts: dict[str, str]
    moves: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    before: Callable[[Path], object] | None = None


def _edits(name: str, *pairs: tuple[str, str]) -> Callable[[Path], object]:
    return lambda folder: replace(folder, name, *pairs)


def _rename(folder: Path, *, following: bool) -> None:
    (folder / "paint.png").rename(folder / "coat.png")
    if following:
        replace(folder, "asset", ("@./paint.png@", "@./coat.png@"))


def _two(folder: Path) -> None:
    replace(folder, "lights", ("intensity = 3", "intensity = 6"))
    replace(folder, "asset", ("roughness = 0.6", "roughness = 0.2"))


def _late(folder: Path) -> None:
    (folder / "late.usda").write_text(LATE)


def _pointed(folder: Path) -> None:
    (folder / "paint.png").write_text(POINTER)


CHANGED, SAME = {"shot.usda": "changed"}, {"shot.usda": "identical"}
MOVER = "/World/mover"
COMMITS = (
    Commit("light", _edits("lights", ("intensity = 3", "intensity = 6")), 1, CHANGED, (KEY,)),
    Commit("light type", _edits("lights", ("DistantLight", "SphereLight")), 1, CHANGED, ("/World/key [typeName]",)),
    Commit(
        "light deactivated",
        _edits("lights", ('"key"\n', '"key" (\n active = false\n)\n')),
        1,
        CHANGED,
        ("/World/key [active]",),
    ),
    Commit("material", _edits("asset", ("roughness = 0.6", "roughness = 0.1")), 1, CHANGED, (SHADER,)),
    Commit("transform", _edits("shot", ("(-1.2, 0, 0)", "(-1.0, 0, 0)")), 1, CHANGED, (LEFT,)),
    Commit("camera", _edits("shot", ("(0, 0, 8)", "(0, 0, 7)")), 1, CHANGED, ("/World/cam.xformOp:translate",)),
    Commit("points", _edits("asset", ("(0.8, 0.8, 0),", "(0.8, 0.4, 0),")), 1, CHANGED, ("/Asset/card.points",)),
    Commit("variant selected", _edits("shot", ('"small"', '"big"')), 1, CHANGED, ("/World/right [variantSelection]",)),
    Commit(
        "variant edited",
        _edits("asset", ("(0.5, 0.5, 0.5)", "(0.7, 0.7, 0.7)")),
        1,
        CHANGED,
        ("/Asset{size=small}card.xformOp:scale",),
    ),
    Commit("variant without use", _edits("asset", ("(2, 2, 2)", "(3, 3, 3)")), 0, SAME),
    Commit(
        "first sample",
        _edits("shot", ("1: (0, 1, 0)", "1: (0, 0.8, 0)")),
        1,
        CHANGED,
        (f"{MOVER}.xformOp:translate [timeSamples]",),
    ),
    Commit(
        "last sample",
        _edits("shot", ("10: (0, -1, 0)", "10: (0, -0.8, 0)")),
        1,
        CHANGED,
        (f"{MOVER}.xformOp:translate [timeSamples]",),
    ),
    Commit(
        "reference taken away", _edits("shot", ("references = @./asset.usda@", "")), 1, CHANGED, ("/World/left [references]",)
    ),
    Commit(
        "reference to another",
        _edits("shot", ("@./asset.usda@", "@./other.usda@</ball>")),
        1,
        CHANGED,
        ("/World/left [references]",),
    ),
    Commit(
        "list op",
        _edits("shot", ("references = @./asset.usda@", "prepend references = [@./other.usda@</ball>, @./asset.usda@]")),
        1,
        CHANGED,
        ("/World/left [references]",),
    ),
    Commit("schema taken back, still bound", _edits("asset", ("prepend apiSchemas", "delete apiSchemas")), 0, SAME),
    Commit("order of transforms", _edits("shot", ('["xformOp:translate"]', "[]")), 1, CHANGED, ("/World/cam.xformOpOrder",)),
    Commit(
        "binding",
        _edits("asset", ("        rel material:binding = </Asset/M>\n", "")),
        1,
        CHANGED,
        ("/Asset/card.material:binding",),
    ),
    Commit(
        "connection",
        _edits("asset", ("inputs:diffuseColor.connect = </Asset/M/t.outputs:rgb>", "inputs:diffuseColor = (1, 0, 0)")),
        1,
        CHANGED,
        ("/Asset/M/s.inputs:diffuseColor [connectionPaths]",),
    ),
    Commit("up axis", _edits("shot", ('upAxis = "Y"', 'upAxis = "Z"')), 0, SAME),
    Commit(
        "visibility",
        _edits("shot", ("double radius = 0.2", 'token visibility = "invisible"\n        double radius = 0.2')),
        1,
        CHANGED,
        (f"{MOVER}.visibility",),
    ),
    Commit(
        "prim added",
        _edits("lights", ("    def Dist", '    def Sphere "more"\n    {\n    }\n    def Dist')),
        1,
        CHANGED,
        ("/World/more",),
    ),
    Commit(
        "sublayer taken out",
        _edits("shot", ("    subLayers = [@./lights.usda@]\n", "")),
        1,
        CHANGED,
        ("/ [subLayers]",),
    ),
    Commit("layer deleted", lambda f: (f / "lights.usda").unlink(), 1, CHANGED, ("lights.usda (deleted)",)),
    Commit("texture painted", lambda f: paint(f / "paint.png", 60), 1, CHANGED, ("paint.png",)),
    Commit("texture renamed", lambda f: _rename(f, following=False), 1, CHANGED, ("paint.png -> coat.png",)),
    Commit("texture renamed and followed", lambda f: _rename(f, following=True), 0, SAME),
    Commit("missing layer comes", _late, 1, CHANGED, ("late.usda (new)",)),
    Commit("syntax error", _edits("lights", ("float inputs", "float float inputs")), 3, CHANGED),
    Commit(
        "syntax error mended",
        _edits("lights", ("float float inputs", "float inputs")),
        1,
        CHANGED,
        ("lights.usda",),
        before=_edits("lights", ("float inputs", "float float inputs")),
    ),
    Commit(
        "syntax error on both sides",
        _edits("lights", ("intensity = 3", "intensity = 4")),
        6,
        SAME,
        before=_edits("lights", ("float inputs", "float float inputs")),
    ),
    Commit("stage with a syntax error", _edits("other", ("color3f[]", "color3f")), 3, {"other.usda": "broken"}),
    Commit(
        "stage mended",
        _edits("other", ("color4f", "color3f[]")),
        1,
        {"other.usda": "mended"},
        before=_edits("other", ("color3f[]", "color4f")),
    ),
    Commit(
        "stage with a syntax error on both sides",
        _edits("other", ("0.8, 0.1", "0.1, 0.8")),
        6,
        {"other.usda": "unrendered"},
        before=_edits("other", ("color3f[]", "color4f ")),
    ),
    Commit("pointer", _pointed, 1, CHANGED, ("paint.png",)),
    Commit("comment", _edits("lights", ("#usda 1.0\n", "#usda 1.0\n# a comment\n")), 0, SAME),
    Commit("documentation", _edits("asset", ('defaultPrim = "Asset"', 'defaultPrim = "Asset"\n    doc = "words"')), 0, SAME),
    Commit("two edits", _two, 1, CHANGED, (KEY, SHADER)),
    Commit(
        "one with effect, one without",
        _edits("lights", ("float inputs:intensity = 3", "float inputs:intensity = 4\n        custom float mine = 2")),
        1,
        CHANGED,
        (KEY,),
        ("/World/key.mine",),
    ),
    Commit("stage added", lambda f: (f / "new.usda").write_text(OTHER), 1, {"new.usda": "new"}),
    Commit(
        "other stage", _edits("other", ("0.8, 0.1", "0.1, 0.8")), 1, {"other.usda": "changed"}, ("/ball.primvars:displayColor",)
    ),
    Commit("stage deleted", lambda f: (f / "other.usda").unlink(), 1, {"other.usda": "deleted"}),
    Commit("no stage", lambda f: (f / "README").write_text("words\n"), 0, {}),
)
