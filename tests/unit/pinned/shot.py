"""A small stage with a texture, a light and two shapes, and its pinned picture."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from primray.images.image import write_png
from primray.pinned.lock import seal

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World"
{
    def Camera "camera"
    {
        float2 clippingRange = (0.1, 100)
        matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0.2, 7, 1))
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }
    def Sphere "ball"
    {
        color3f[] primvars:displayColor = [(0.7, 0.3, 0.2)]
    }
    def Mesh "wall" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-3, -2, -2), (3, -2, -2), (3, 2, -2), (-3, 2, -2)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
            interpolation = "vertex"
        )
        rel material:binding = </World/paint>
    }
    def Material "paint"
    {
        token outputs:surface.connect = </World/paint/shader.outputs:surface>
        def Shader "shader"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/paint/picture.outputs:rgb>
            token outputs:surface
        }
        def Shader "picture"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./paint.png@
            float2 inputs:st.connect = </World/paint/st.outputs:result>
            float3 outputs:rgb
        }
        def Shader "st"
        {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }
    def RectLight "lamp"
    {
        float inputs:intensity = 30
        float inputs:width = 2
        float inputs:height = 2
        matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 3, 0, 1))
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }
}
"""


def write_shot(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    write_texture(folder, 200)
    stage = folder / "shot.usda"
    stage.write_text(STAGE)
    return stage


def write_texture(folder: Path, value: int) -> None:
    """Write the wall's texture, grey but for one texel of this value."""
    texels = np.full((8, 8, 3), 120, np.uint8)
    texels[3, 4] = value
    write_png(texels, folder / "paint.png")


def changed(lock: Path, change: Callable[[dict[str, Any]], None], *, sealed: bool = True) -> Path:
    """Change a lock's JSON, with new seals, as a forger would, or without."""
    found = json.loads(lock.read_text())
    change(found)
    if sealed:
        found["seals"] = {name: seal(found[name]) for name in found["seals"]}
    lock.write_text(json.dumps(found))
    return lock
