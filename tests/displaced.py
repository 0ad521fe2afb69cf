"""Stages with displaced meshes, and what they are diced to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from pxr import Usd

from primray import core, usd
from primray.core.displacement_upload import displacements
from primray.description import Mesh, SceneDescription
from primray.diagnostics import Diagnostics
from primray.render.prepare import load_textures
from primray.settings import RenderSettings
from primray.tessellation.dice import Dicing, Warnings, dice

SETTINGS = RenderSettings(resolution=(64, 64))

# Squares with two rows of faces, as polygons or as a cage, and with BODY in them.
QUADS = """def Mesh "plane" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    uniform token subdivisionScheme = "SCHEME"
    int[] faceVertexCounts = [4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7]
    point3f[] points = [(0,0,0), (1,0,0), (2,0,0), (0,1,0), (1,1,0), (2,1,0), (0,2,0), (1,2,0), (2,2,0)]
    texCoord2f[] primvars:st = [(0,0), (.5,0), (1,0), (0,.5), (.5,.5), (1,.5), (0,1), (.5,1), (1,1)] (
        interpolation = "vertex"
    )
    rel material:binding = </m>
    BODY
}
"""
CUBE = """def Mesh "cube" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    uniform token subdivisionScheme = "SCHEME"
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    point3f[] points = [(-1,-1,-1), (-1,-1,1), (-1,1,-1), (-1,1,1), (1,-1,-1), (1,-1,1), (1,1,-1), (1,1,1)]
    texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] (
        interpolation = "faceVarying"
    )
    int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3]
    rel material:binding = </m>
    BODY
}
"""


def preview(inputs: str, nodes: str = "", name: str = "m") -> str:
    """A UsdPreviewSurface that displaces."""
    return f"""def Material "{name}" {{
    token outputs:surface.connect = </{name}/s.outputs:surface>
    token outputs:displacement.connect = </{name}/s.outputs:displacement>
    def Shader "s" {{
        uniform token info:id = "UsdPreviewSurface"
        {inputs}
        token outputs:surface
        token outputs:displacement
    }}
    {nodes}
}}
"""


def materialx(inputs: str, nodes: str = "", kind: str = "float", name: str = "m") -> str:
    """A MaterialX displacement beside a grey surface."""
    return f"""def Material "{name}" {{
    token outputs:surface.connect = </{name}/s.outputs:surface>
    token outputs:mtlx:displacement.connect = </{name}/d.outputs:out>
    def Shader "s" {{
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }}
    def Shader "d" {{
        uniform token info:id = "ND_displacement_{kind}"
        {inputs}
        token outputs:out
    }}
    {nodes}
}}
"""


def node(name: str, identifier: str, inputs: str, output: str) -> str:
    return f"""def Shader "{name}" {{
        uniform token info:id = "{identifier}"
        {inputs}
        {output}
    }}
    """


POSITION = node("p", "ND_position_vector3", 'string inputs:space = "object"', "float3 outputs:out")


def described(text: str, settings: RenderSettings = SETTINGS, at: Path | None = None) -> tuple[SceneDescription, Diagnostics]:
    """A stage's description; its textures lie beside it."""
    stage = Usd.Stage.CreateInMemory() if at is None else Usd.Stage.CreateNew(str(at / "stage.usda"))
    stage.GetRootLayer().ImportFromString(f'#usda 1.0\n(\n    upAxis = "Y"\n)\n{text.replace("BODY", "")}')
    return usd.translate(stage, settings)


def diced(
    text: str, dicing: Dicing | None = None, at: Path | None = None, settings: RenderSettings = SETTINGS
) -> tuple[list[Mesh], Warnings]:
    """All of a stage's meshes."""
    description, diagnostics = described(text, settings, at)
    description, textures = load_textures(description, diagnostics, usd.read_asset)
    displaced = displacements(description, textures)
    made, warnings = dice(core.compiled, description, dicing or Dicing(8.0), 2, displaced)
    meshes = [shape for shape in made.shapes if isinstance(shape, Mesh)]
    told = [
        (d.code, d.prim_path, d.message)
        for d in diagnostics
        if d.code not in ("default-light", "skewed-instance") and "camera" not in d.code
    ]
    return meshes, [*told, *warnings]


def uniform(level: int) -> Dicing:
    return Dicing(1.0, level, level)


def holes(mesh: Mesh) -> int:
    """Edges that do not join two triangles which run along them in opposite directions."""
    t = mesh.triangles.astype(np.int64)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    size = len(mesh.points)
    forward, backward = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    names, counts = np.unique(forward, return_counts=True)
    return int((counts != 1).sum()) + len(np.setxor1d(names, backward))


def normals_by_corner(mesh: Mesh) -> npt.NDArray[np.float32]:
    """(3T, 3)."""
    assert mesh.normals is not None
    return mesh.normals if len(mesh.normals) == 3 * len(mesh.triangles) else mesh.normals[mesh.triangles.ravel()]
