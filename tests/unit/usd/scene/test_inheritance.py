"""What any prim may carry (visibility, purpose, transforms, primvars, collections, clips): the description says the same."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from primray.description import Interpolation, Mesh
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of, translate_text


def conforms(row: str, *values: Any, state: str = "honoured") -> Any:
    return pytest.param(*values, marks=pytest.mark.conforms(row, state=state), id=row)


def drawn(text: str, settings: RenderSettings | None = None) -> list[str]:
    return [shape.path for shape in translate_text(text, settings)[0].shapes]


@pytest.mark.conforms("Imageable.visibility")
def test_visibility() -> None:
    """Nothing below an invisible prim is visible, whatever it says."""
    text = 'def Xform "a"\n{\ntoken visibility = "%s"\ndef Sphere "s"\n{\ntoken visibility = "inherited"\n}\n}\n'
    assert drawn(text % "invisible") == []
    assert drawn(text % "inherited") == ["/a/s"]


@pytest.mark.conforms("Imageable.purpose")
@pytest.mark.parametrize("purpose", ["default", "render", "proxy", "guide"])
def test_purpose(purpose: str) -> None:
    text = f'def Xform "a"\n{{\nuniform token purpose = "{purpose}"\ndef Sphere "s"\n{{\n}}\n}}\n'
    assert drawn(text) == (["/a/s"] if purpose in ("default", "render") else [])
    assert drawn(text, RenderSettings(purposes=(purpose,))) == ["/a/s"]


@pytest.mark.conforms("Imageable.proxyPrim", state="no effect")
def test_a_proxy_prim_is_a_hint_for_viewers() -> None:
    text = """def Sphere "s"
{
    uniform token purpose = "render"
    MORE
}
def Sphere "p"
{
    uniform token purpose = "proxy"
}
"""
    plain, found = translate_text(text.replace("MORE", ""))
    told, found_too = translate_text(text.replace("MORE", "rel proxyPrim = </p>"))
    assert [s.path for s in plain.shapes] == [s.path for s in told.shapes] == ["/s"]
    assert found == found_too


PURPOSES = """def Xform "a" (prepend apiSchemas = ["VisibilityAPI"])
{
    uniform token %s = "%s"
    def Xform "b" (prepend apiSchemas = ["VisibilityAPI"])
    {
        uniform token %s = "%s"
        def Sphere "s"
        {
            uniform token purpose = "%s"
        }
    }
}
"""


@pytest.mark.parametrize(
    ("above", "below", "visible"),
    [
        ("invisible", "inherited", True),  # ComputeEffectiveVisibility: an authored "inherited" ends the search
        ("inherited", "invisible", False),
        ("invisible", "visible", True),
        ("visible", "invisible", False),
        ("inherited", "inherited", True),
    ],
)
@pytest.mark.parametrize(
    "purpose",
    [
        conforms("VisibilityAPI.guideVisibility", "guide"),
        conforms("VisibilityAPI.proxyVisibility", "proxy"),
        conforms("VisibilityAPI.renderVisibility", "render"),
    ],
)
def test_visibility_by_purpose(purpose: str, above: str, below: str, visible: bool) -> None:
    name = f"{purpose}Visibility"
    text = PURPOSES % (name, above, name, below, purpose)
    settings = RenderSettings(purposes=("default", purpose))
    assert drawn(text, settings) == (["/a/b/s"] if visible else [])
    stage = stage_of(text)
    shape = UsdGeom.Imageable(stage.GetPrimAtPath("/a/b/s"))
    assert (shape.ComputeEffectiveVisibility(purpose) != UsdGeom.Tokens.invisible) == visible
    other = "render" if purpose != "render" else "proxy"
    assert drawn(PURPOSES % (name, above, name, below, other), RenderSettings(purposes=(other,))) == ["/a/b/s"]
    assert drawn(text.replace('(prepend apiSchemas = ["VisibilityAPI"])', ""), settings) == ["/a/b/s"]  # needs its schema


@pytest.mark.conforms("VisibilityAPI.renderVisibility")
def test_visibility_by_purpose_reaches_into_instances() -> None:
    text = """class "proto"
{
    def Sphere "s"
    {
        uniform token purpose = "render"
    }
}
def Xform "hidden" (prepend apiSchemas = ["VisibilityAPI"])
{
    uniform token renderVisibility = "invisible"
    def Xform "i" (
        instanceable = true
        references = </proto>
    )
    {
    }
}
"""
    assert drawn(text) == []
    assert drawn(text.replace('"invisible"', '"visible"')) != []


def matrix(ops: str, order: str, time: float | None = None) -> np.ndarray:
    text = 'def Xform "up"\n{\ndouble3 xformOp:translate = (100, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n'
    text += f'def Sphere "s"\n{{\n{ops}\nuniform token[] xformOpOrder = [{order}]\n}}\n}}\n'
    return np.asarray(translate_text(text, RenderSettings(time_code=time))[0].static[0].matrix)


def moved(inner: np.ndarray) -> np.ndarray:
    outer = np.eye(4)
    outer[0, 3] = 100
    return np.asarray(outer @ inner)


def rotation(axis: int, degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    m, (i, j) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
    m[i, i], m[j, j], m[i, j], m[j, i] = c, c, -s, s
    return m


def translation(x: float, y: float, z: float) -> np.ndarray:
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


@pytest.mark.parametrize(
    ("ops", "order", "expected"),
    [
        conforms(
            "Xformable.xformOp:translate", "double3 xformOp:translate = (1, 2, 3)", '"xformOp:translate"', translation(1, 2, 3)
        ),
        conforms("Xformable.xformOp:scale", "float3 xformOp:scale = (1, 2, 3)", '"xformOp:scale"', np.diag([1, 2, 3, 1])),
        conforms("Xformable.xformOp:rotate", "float xformOp:rotateX = 30", '"xformOp:rotateX"', rotation(0, 30)),
        conforms("Xformable.xformOp:rotate", "float xformOp:rotateY = 30", '"xformOp:rotateY"', rotation(1, 30)),
        conforms("Xformable.xformOp:rotate", "double xformOp:rotateZ = 30", '"xformOp:rotateZ"', rotation(2, 30)),
        conforms(
            "Xformable.xformOp:rotate",
            "float3 xformOp:rotateXYZ = (10, 20, 30)",
            '"xformOp:rotateXYZ"',
            rotation(2, 30) @ rotation(1, 20) @ rotation(0, 10),  # about X first
        ),
        conforms(
            "Xformable.xformOp:rotate",
            "float3 xformOp:rotateZXY = (10, 20, 30)",
            '"xformOp:rotateZXY"',
            rotation(1, 20) @ rotation(0, 10) @ rotation(2, 30),
        ),
        conforms(
            "Xformable.xformOp:orient", "quatf xformOp:orient = (0.8, 0.6, 0, 0)", '"xformOp:orient"', rotation(0, 73.7397953)
        ),
        conforms(
            "Xformable.xformOp:transform",
            "matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (5, 6, 7, 1))",
            '"xformOp:transform"',
            translation(5, 6, 7) @ rotation(0, 90),
        ),
        conforms(
            "Xformable.xformOpOrder",
            "double3 xformOp:translate = (1, 0, 0)\nfloat xformOp:rotateZ = 90",
            '"xformOp:translate", "xformOp:rotateZ"',
            translation(1, 0, 0) @ rotation(2, 90),
        ),
        conforms(
            "Xformable.xformOpOrder",
            "double3 xformOp:translate = (1, 0, 0)\nfloat xformOp:rotateZ = 90",
            '"xformOp:rotateZ", "xformOp:translate"',
            rotation(2, 90) @ translation(1, 0, 0),
        ),
        conforms(
            "Xformable.xformOpOrder", "double3 xformOp:translate = (1, 0, 0)", "", np.eye(4)
        ),  # not in the order: no effect
        conforms(
            "Xformable.!invert!",
            "double3 xformOp:translate:pivot = (0, 1, 0)\nfloat xformOp:rotateZ = 90",
            '"xformOp:translate:pivot", "xformOp:rotateZ", "!invert!xformOp:translate:pivot"',
            translation(0, 1, 0) @ rotation(2, 90) @ translation(0, -1, 0),
        ),
    ],
)
def test_transforms(ops: str, order: str, expected: np.ndarray) -> None:
    assert matrix(ops, order) == pytest.approx(moved(expected), abs=1e-6)


@pytest.mark.conforms("Xformable.!resetXformStack!")
def test_a_reset_leaves_what_is_above_out() -> None:
    found = matrix("double3 xformOp:translate = (1, 2, 3)", '"!resetXformStack!", "xformOp:translate"')
    assert found == pytest.approx(translation(1, 2, 3))


READER = """def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/r.outputs:result>
        token outputs:surface
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "p"
        float3 outputs:result
    }
}
def Mesh "mesh" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    %s
}
"""
FOUR = "[(0.1, 0, 0), (0.2, 0, 0), (0.3, 0, 0), (0.4, 0, 0)]"


TWO = "[(0.1, 0, 0), (0.2, 0, 0)]"


@pytest.mark.parametrize(
    ("authored", "kind", "red"),
    [
        conforms("PrimvarsAPI.primvars:NAME", "color3f[] primvars:p = [(0.5, 0, 0)] ('constant')", "CONSTANT", [0.5]),
        conforms("PrimvarsAPI.interpolation", f"color3f[] primvars:p = {FOUR} ('vertex')", "POINT", [0.1, 0.2, 0.3, 0.4]),
        conforms("PrimvarsAPI.interpolation", f"color3f[] primvars:p = {FOUR} ('varying')", "POINT", [0.1, 0.2, 0.3, 0.4]),
        conforms("PrimvarsAPI.interpolation", f"color3f[] primvars:p = {TWO} ('uniform')", "FACE", [0.1, 0.2]),
        conforms(
            "PrimvarsAPI.primvars:NAME:indices",
            f"color3f[] primvars:p = {TWO} ('faceVarying')\nint[] primvars:p:indices = [0, 1, 1, 0, 0, 1]",
            "CORNER",
            [0.1, 0.2, 0.2, 0.1, 0.1, 0.2],
        ),
        conforms(
            "PrimvarsAPI.elementSize",
            "float[] primvars:p = [0.1, 0, 0, 0.2, 0, 0] (\n interpolation = 'uniform'\n elementSize = 3\n)",
            "FACE",
            [0.1, 0.2],
        ),
    ],
)
def test_primvars(authored: str, kind: str, red: list[float]) -> None:
    (shape,) = translate_text(READER % authored.replace("('", "(interpolation = '"))[0].shapes
    assert isinstance(shape, Mesh)
    (primvar,) = shape.primvars
    assert primvar.interpolation is Interpolation[kind]
    assert primvar.values[:, 0].tolist() == pytest.approx(red)


@pytest.mark.conforms("PrimvarsAPI.unauthoredValuesIndex", state="no effect")
def test_which_values_are_unauthored_matters_to_whoever_authors() -> None:
    authored = "color3f[] primvars:p = [(0.1, 0, 0), (0.2, 0, 0)] (\n interpolation = 'uniform'%s\n)"
    authored += "\nint[] primvars:p:indices = [1, 0]"
    plain, found = translate_text(READER % (authored % ""))
    told, found_too = translate_text(READER % (authored % "\n unauthoredValuesIndex = 0"))
    assert found == found_too
    for shape in (plain.shapes[0], told.shapes[0]):
        assert isinstance(shape, Mesh)
        assert shape.primvars[0].values[:, 0].tolist() == pytest.approx([0.2, 0.1])


CLIP = '#usda 1.0\n(\n startTimeCode = 0\n endTimeCode = 10\n)\ndef "s"\n{\n double radius.timeSamples = { 0: %s, 10: %s }\n}\n'
MANIFEST = '#usda 1.0\ndef "s"\n{\n double radius\n}\n'


@pytest.mark.conforms("ClipsAPI.clips", "ClipsAPI.clipSets")
def test_value_clips(tmp_path: Path) -> None:
    """USD resolves them; the time that is rendered reaches them, and the first clip set is the strongest."""
    for name, text in (("a", CLIP % (2, 4)), ("b", CLIP % (20, 40)), ("manifest", MANIFEST)):
        (tmp_path / f"{name}.usda").write_text(text)
    one = 'dictionary {name} = {{\n asset[] assetPaths = [@./{file}.usda@]\n string primPath = "/s"\n'
    one += " double2[] active = [(0, 0)]\n double2[] times = [(0, 0), (10, 10)]\n"
    one += " asset manifestAssetPath = @./manifest.usda@\n}}\n"
    sets = one.format(name="x", file="a") + one.format(name="y", file="b")
    root = tmp_path / "root.usda"
    for order, radius in (('["x", "y"]', 3), ('["y", "x"]', 30)):
        root.write_text(f'#usda 1.0\ndef Sphere "s" (\n clips = {{\n{sets} }}\n clipSets = {order}\n)\n{{\n}}\n')
        stage = Usd.Stage.Open(str(root), Usd.Stage.LoadAll)
        stage.Reload()
        (shape,) = translate(stage, RenderSettings(time_code=5.0))[0].shapes
        assert shape.radius == radius  # type: ignore[union-attr]


COLLECTED = """def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
def Xform "w" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:c", "CollectionAPI:d"])
{
    rel material:binding:collection:c = [</w.collection:c>, </m>]
    %s
    def Xform "g"
    {
        def Sphere "a"
        {
        }
    }
    def Sphere "b"
    {
    }
}
"""
EXPRESSION = 'uniform pathExpression collection:c:membershipExpression = "/w/b"'


@pytest.mark.parametrize(
    ("authored", "members"),
    [
        conforms("CollectionAPI.includes", "rel collection:c:includes = </w/g>", {"/w/g/a"}),
        conforms("CollectionAPI.excludes", "rel collection:c:includes = </w>\nrel collection:c:excludes = </w/g>", {"/w/b"}),
        conforms(
            "CollectionAPI.expansionRule",
            'rel collection:c:includes = [</w/g>, </w/b>]\nuniform token collection:c:expansionRule = "explicitOnly"',
            {"/w/b"},
        ),
        conforms("CollectionAPI.includeRoot", "uniform bool collection:c:includeRoot = true", {"/w/g/a", "/w/b"}),
        conforms("CollectionAPI.membershipExpression", EXPRESSION, {"/w/b"}),
        conforms("CollectionAPI.mode", f"{EXPRESSION}\nrel collection:c:includes = </w/g>", {"/w/g/a"}),
        conforms(
            "CollectionAPI.mode",
            f'{EXPRESSION}\nrel collection:c:includes = </w/g>\nuniform token collection:c:mode = "expression"',
            {"/w/b"},
        ),
        conforms("CollectionAPI.mode", f'{EXPRESSION}\nuniform token collection:c:mode = "relationship"', set()),
        conforms(
            "CollectionAPI.__INSTANCE_NAME__",
            "rel collection:c:includes = </w.collection:d>\nrel collection:d:includes = </w/b>",
            {"/w/b"},
        ),
        conforms("MaterialBindingAPI.material:binding:collection", "rel collection:c:includes = </w>", {"/w/g/a", "/w/b"}),
    ],
)
def test_collections_that_bind_materials(authored: str, members: set[str]) -> None:
    """The one use of collections for shapes; lights' are linked by theirs."""
    description, _ = translate_text(COLLECTED % authored)
    bound = {shape.path for shape in description.shapes if description.surfaces[int(np.max(shape.surface))].path == "/m"}
    assert bound == members
