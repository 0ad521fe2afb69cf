"""Stages with something wrong, each with its files: the first is the root."""

from __future__ import annotations

from pathlib import Path

from pxr import Usd

HEAD = '#usda 1.0\n(\n    defaultPrim = "W"\n)\n'
BALL = """def Sphere "ball"
{
}
def DistantLight "sun"
{
}
def Camera "cam"
{
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
BROKEN = f'{HEAD}def Xform "W"\n{{\n    double radius = = 3\n}}\n'
POINTER = f"version https://git-lfs.github.com/spec/v1\noid sha256:{'a' * 64}\nsize 12345\n"
MATERIAL = """def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </M>
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
}
def Material "M"
{
    token outputs:surface.connect = </M/P.outputs:surface>
    def Shader "P"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
        token outputs:surface
    }
    def Shader "T"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @textures/wood.png@
        float3 outputs:rgb
    }
}
"""


def sublayers(*paths: str) -> str:
    return f"#usda 1.0\n(\n    subLayers = [{', '.join(f'@{path}@' for path in paths)}]\n)\n{BALL}"


def referring(asset: str) -> str:
    return f'{HEAD}def Xform "W" (references = {asset})\n{{\n}}\n{BALL}'


def truncated_crate(folder: Path) -> bytes:
    stage = Usd.Stage.CreateNew(str(folder / "whole.usdc"))
    stage.DefinePrim("/W", "Sphere")
    stage.GetRootLayer().Save()
    data = (folder / "whole.usdc").read_bytes()
    return data[: len(data) // 2]


# A render goes on without what is wrong.
RENDERED: dict[str, dict[str, str | bytes]] = {
    "parse error in a sublayer": {"shot.usda": sublayers("layers/bad.usda"), "layers/bad.usda": BROKEN},
    "parse error in a reference": {"shot.usda": referring("@layers/bad.usda@"), "layers/bad.usda": BROKEN},
    "missing sublayer": {"shot.usda": sublayers("layers/no.usda"), "layers/ok.usda": sublayers()},
    "missing reference": {"shot.usda": referring("@no.usda@")},
    "missing target": {"shot.usda": referring("@ok.usda@</No>"), "ok.usda": HEAD + 'def "W"\n{\n}\n'},
    "cycle": {"shot.usda": referring("@b.usda@"), "b.usda": HEAD + 'def "W" (references = @shot.usda@)\n{\n}\n'},
    "missing texture": {"shot.usda": f"#usda 1.0\n{BALL}{MATERIAL}"},
    "unreadable texture": {"shot.usda": f"#usda 1.0\n{BALL}{MATERIAL}", "textures/wood.png": "no picture"},
    "pointer for a texture": {"shot.usda": f"#usda 1.0\n{BALL}{MATERIAL}", "textures/wood.png": POINTER},
    "pointer for a layer": {"shot.usda": sublayers("layers/set.usda"), "layers/set.usda": POINTER},
    "no USD for a layer": {"shot.usda": sublayers("layers/set.usda"), "layers/set.usda": "hello\n"},
    "unknown format": {"shot.usda": referring("@data.abc@"), "data.abc": "x"},
    "missing dome": {"shot.usda": f'#usda 1.0\n{BALL}def DomeLight "d"\n{{\n    asset inputs:texture:file = @sky.exr@\n}}\n'},
    "not rendered": {
        "shot.usda": f'#usda 1.0\n{BALL}def ParticleField "a"\n{{\n}}\ndef ParticleField "b"\n{{\n}}\ndef Volume "c"\n{{\n}}\n'
        'def PluginLight "p"\n{\n}\ndef Nonsense "n"\n{\n}\n'
    },
    "other units": {
        "shot.usda": referring("@b.usda@"),
        "b.usda": HEAD.replace(")", "    metersPerUnit = 3\n)") + 'def "W"\n{\n}\n',
    },
}
# Nothing can be rendered.
REFUSED: dict[str, dict[str, str | bytes]] = {
    "parse error": {"shot.usda": BROKEN},
    "pointer": {"shot.usda": POINTER},
    "no USD": {"shot.usda": "hello\n"},
}


def write(folder: Path, files: dict[str, str | bytes]) -> Path:
    """The root's path."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / next(iter(files))
