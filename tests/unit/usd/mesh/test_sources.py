"""Prims whose geometry is authored at the same place are read once; those with opinions of their own, each for itself."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd

from primray.description import Mesh
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.mesh import adapter
from primray.usd.scene.context import Context
from primray.usd.scene.inheritance import ResolvedPrim

from ..usd_text import stage_of

KIND = """class Scope "kinds"
{
    def Mesh "kind"
    {
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 2, 1, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.5)]
        uniform token subdivisionScheme = "none"
    }
}
"""
PLACED = """def "%s" (
    references = </kinds/kind>
)
{
    double3 xformOp:translate = (%d, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    %s
}
"""


def counted(
    stage: Usd.Stage, monkeypatch: pytest.MonkeyPatch, settings: RenderSettings | None = None
) -> tuple[int, list[Mesh]]:
    """How many meshes are read, and all of them."""
    reads, read = list[object](), adapter._read_geometry

    def counting(prim: ResolvedPrim, ctx: Context) -> object:
        reads.append(prim)
        return read(prim, ctx)

    monkeypatch.setattr(adapter, "_read_geometry", counting)
    d, _ = translate(stage, settings or RenderSettings())
    return len(reads), [shape for shape in d.shapes if isinstance(shape, Mesh)]


def test_prims_that_are_only_placed_and_coloured(monkeypatch: pytest.MonkeyPatch) -> None:
    own = ["", "color3f[] primvars:displayColor = [(1, 0, 0)]", 'token purpose = "default"', ""]
    stage = stage_of(KIND + "".join(PLACED % (f"p{k}", k, text) for k, text in enumerate(own)))
    reads, meshes = counted(stage, monkeypatch)
    assert (reads, len(meshes)) == (1, 4)
    assert len({id(mesh.points) for mesh in meshes}) == len({id(mesh.triangles) for mesh in meshes}) == 1
    assert [mesh.path for mesh in meshes] == ["/p0", "/p1", "/p2", "/p3"]
    assert len({mesh.surface for mesh in meshes}) == 2


def test_meshes_below_a_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of them is authored where they are, but for what hides, moves or shapes one."""
    kind = KIND.replace('def Mesh "kind"', 'def Xform "kind"\n    {\n    def Mesh "body"') + "}\n"
    below = 'over "body"\n{\n%s\n}\n'
    own = [
        "",
        below % "double3 xformOp:translate = (0, 1, 0)",
        below % "point3f[] points = [(0, 0, 0), (3, 0, 0), (0, 3, 0), (1, 1, 1)]",
    ]
    stage = stage_of(kind + "".join(PLACED % (f"p{k}", k, text) for k, text in enumerate([*own, ""])))
    reads, meshes = counted(stage, monkeypatch)
    assert (reads, [mesh.path for mesh in meshes]) == (2, [f"/p{k}/body" for k in range(4)])
    assert meshes[0].points is meshes[1].points is meshes[3].points
    assert meshes[2].points[1, 0] == 3


@pytest.mark.parametrize(
    "own",
    [
        "point3f[] points = [(0, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0.5)]",
        "int[] holeIndices = [1]",
        'uniform token orientation = "leftHanded"',
        'uniform token subdivisionScheme = "catmullClark"',
        "normal3f[] primvars:normals = [(0, 0, 1)]",
    ],
)
def test_an_opinion_on_the_geometry(own: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = stage_of(KIND + PLACED % ("a", 0, "") + PLACED % ("b", 1, own) + PLACED % ("c", 2, ""))
    reads, _ = counted(stage, monkeypatch)
    assert reads == 2
    alone, _ = translate(stage_of(KIND + PLACED % ("b", 1, own)), RenderSettings())
    d, _ = translate(stage, RenderSettings())
    for name in ("points", "triangles", "face_points", "normals"):
        if hasattr(alone.shapes[0], name):
            np.testing.assert_array_equal(getattr(d.shapes[1], name), getattr(alone.shapes[0], name))


def test_what_is_reported_is_reported_of_each() -> None:
    bad = KIND.replace("[0, 1, 2, 2, 1, 3]", "[0, 1, 2, 2, 1, 9]")
    _, told = translate(stage_of(bad + PLACED % ("a", 0, "") + PLACED % ("b", 1, "")), RenderSettings())
    assert [d.prim_path for d in told if d.code == "faces-dropped"] == ["/a", "/b"]


def test_types_and_times_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    samples = "point3f[] points.timeSamples = { 1: [(0, 0, 0), (1, 0, 0), (0, 2, 0), (1, 1, 0)] }"
    timed = KIND.replace("point3f[] points = ", f"{samples}\n        point3f[] points = ")
    stage = stage_of(timed + PLACED % ("a", 0, "") + PLACED % ("b", 1, ""))
    assert counted(stage, monkeypatch)[0] == 2
    monkeypatch.undo()
    assert counted(stage, monkeypatch, RenderSettings(time_code=1.0))[0] == 2
