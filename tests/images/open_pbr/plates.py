"""A plate with an OpenPBR material before a camera, a white sky or a lamp about it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Usd

import primray
from primray.images.image import Image

HEAD = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Camera "eye"
{{
    token projection = "orthographic"
    float horizontalAperture = 1
    float verticalAperture = 1
    matrix4d xformOp:transform = {view}
    uniform token[] xformOpOrder = ["xformOp:transform"]
}}
def Mesh "plate" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    point3f[] points = [(-{half}, -{half}, 0), ({half}, -{half}, 0), ({half}, {half}, 0), (-{half}, {half}, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    uniform token subdivisionScheme = "none"
    rel material:binding = </material>
}}
def Material "material"
{{
    token outputs:mtlx:surface.connect = </material/surface.outputs:out>
    def Shader "surface"
    {{
        uniform token info:id = "ND_open_pbr_surface_surfaceshader"
        token outputs:out
{inputs}
    }}
}}
"""
SKY = 'def DomeLight "sky"\n{\n    color3f inputs:color = (1, 1, 1)\n}\n'
TYPES = {bool: "bool", float: "float", tuple: "color3f"}


def stage(inputs: dict[str, Any], lights: str = SKY, tilt: float = 0.0, half: float = 50.0, more: str = "") -> Usd.Stage:
    """`tilt`: of the view, in degrees about the vertical axis; 0: along the plate's normal."""
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    view = f"((({c}, 0, {-s}, 0), (0, 1, 0, 0), ({s}, 0, {c}, 0), ({40 * s}, 0, {40 * c}, 1)))"[1:-1]
    text = "\n".join(f"        {TYPES[type(v)]} inputs:{k} = {str(v).lower()}" for k, v in inputs.items())
    made = Usd.Stage.CreateInMemory()
    assert made.GetRootLayer().ImportFromString(HEAD.format(view=view, half=half, inputs=text) + lights + more)
    return made


def image(of: Usd.Stage, **settings: Any) -> Image:
    return primray.render(of, **{"resolution": (8, 8), "spp": 256, **settings})


def seen(of: Usd.Stage, **settings: Any) -> np.ndarray:
    """The mean colour."""
    return np.asarray(image(of, **settings).pixels[..., :3], float).mean((0, 1))
