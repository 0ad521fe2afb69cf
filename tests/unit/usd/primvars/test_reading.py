"""Primvars that materials read: types, interpolations, indices and sizes; where constant ones come from; instances' own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from primray.description import Interpolation, Mesh, Primvar, PrimvarInput, SceneDescription, Sphere
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.mesh.subdivision import cage_primvars

from ..mesh.resolved_cage import resolved_cage
from ..usd_text import stage_of, translate_text


def reader(width: int, name: str = "p", default: str = "") -> str:
    """A material that reads a primvar: 1 number as its roughness, 2 as st of a texture, 3 as its colour."""
    kind = {1: "float", 2: "float2", 3: "float3", 4: "float4"}[width]
    target = {1: "float inputs:roughness", 3: "color3f inputs:diffuseColor", 4: "color3f inputs:diffuseColor"}.get(width)
    connected = f"{target}.connect = </m/r.outputs:result>" if target else ""
    return f"""
def Material "m"
{{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        {connected}
        token outputs:surface
    }}
    def Shader "r"
    {{
        uniform token info:id = "UsdPrimvarReader_{kind}"
        string inputs:varname = "{name}"
        {default}
        {kind} outputs:result
    }}
}}
"""


def quads(primvar: str, extra: str = "") -> str:
    """Two squares side by side: 2 faces, 6 points, 8 corners; triangles 0 and 1 are the first's, 2 and 3 the second's."""
    return f"""
def Mesh "mesh" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </m>
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    {primvar}
    {extra}
}}
"""


def only_mesh(description: SceneDescription) -> Mesh:
    [shape] = description.shapes
    assert isinstance(shape, Mesh)
    return shape


def primvars_of(text: str) -> tuple[tuple[Primvar, ...], set[str]]:
    description, found = translate_text(text)
    return only_mesh(description).primvars, {code for code, _ in found} - {"camera-automatic", "default-light"}


@pytest.mark.parametrize(
    ("interpolation", "values", "kind", "expected"),
    [
        ("constant", "[7]", Interpolation.CONSTANT, [7]),
        ("uniform", "[1, 2]", Interpolation.FACE, [1, 1, 2, 2]),
        ("vertex", "[0, 1, 2, 3, 4, 5]", Interpolation.POINT, [0, 1, 2, 3, 4, 5]),
        ("varying", "[0, 1, 2, 3, 4, 5]", Interpolation.POINT, [0, 1, 2, 3, 4, 5]),
        ("faceVarying", "[0, 1, 2, 3, 4, 5, 6, 7]", Interpolation.CORNER, [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]),
    ],
)
@pytest.mark.parametrize("indexed", [False, True])
@pytest.mark.conforms("PrimvarsAPI.interpolation", "PrimvarsAPI.primvars:NAME:indices")
def test_interpolations(interpolation: str, values: str, kind: Interpolation, expected: list[int], indexed: bool) -> None:
    """Indexed: the values in reverse, and indices that reverse them again."""
    listed = values.strip("[]").split(", ")
    text = f'float[] primvars:p = {values} (interpolation = "{interpolation}")'
    if indexed:
        reverse = f"int[] primvars:p:indices = {list(range(len(listed)))[::-1]}"
        text = f'float[] primvars:p = [{", ".join(listed[::-1])}] (interpolation = "{interpolation}")\n{reverse}'
    [found], codes = primvars_of(reader(1) + quads(text))
    assert (found.name, found.interpolation, found.indices, codes) == ("p", kind, None, set())
    assert found.values.dtype == np.float32
    assert found.values.ravel().tolist() == expected


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        ("float", "0.5", [0.5]),
        ("double", "0.5", [0.5]),
        ("half", "0.5", [0.5]),
        ("int", "3", [3]),
        ("uint", "3", [3]),
        ("int64", "3", [3]),
        ("uchar", "3", [3]),
        ("bool", "true", [1]),
        ("float2", "(1, 2)", [1, 2]),
        ("half2", "(1, 2)", [1, 2]),
        ("double2", "(1, 2)", [1, 2]),
        ("texCoord2f", "(1, 2)", [1, 2]),
        ("texCoord2h", "(1, 2)", [1, 2]),
        ("int2", "(1, 2)", [1, 2]),
        ("float3", "(1, 2, 3)", [1, 2, 3]),
        ("color3f", "(1, 2, 3)", [1, 2, 3]),
        ("color3h", "(1, 2, 3)", [1, 2, 3]),
        ("normal3d", "(1, 2, 3)", [1, 2, 3]),
        ("point3f", "(1, 2, 3)", [1, 2, 3]),
        ("vector3h", "(1, 2, 3)", [1, 2, 3]),
        ("texCoord3d", "(1, 2, 3)", [1, 2, 3]),
        ("color4f", "(1, 2, 3, 4)", [1, 2, 3]),
        ("half4", "(1, 2, 3, 4)", [1, 2, 3]),
    ],
)
@pytest.mark.parametrize("is_array", [True, False])
@pytest.mark.conforms("PrimvarsAPI.primvars:NAME")
def test_types(kind: str, value: str, expected: list[float], is_array: bool) -> None:
    """What is wider than read is cut."""
    text = f"{kind}[] primvars:p = [{value}]" if is_array else f"{kind} primvars:p = {value}"
    width = 3 if len(expected) == 3 else 1
    [found], codes = primvars_of(reader(width) + quads(f'{text} (interpolation = "constant")'))
    assert (found.values.tolist(), codes) == ([expected[:width]], set())


@pytest.mark.parametrize(
    "text",
    [
        'string[] primvars:p = ["a"] (interpolation = "constant")',
        'matrix4d[] primvars:p = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))] (interpolation = "constant")',
        'float[] primvars:p = [1, 2, 3] (interpolation = "vertex")',
        'float[] primvars:p = [1, 2, 3] (interpolation = "uniform")',
        'float[] primvars:p = [1] (interpolation = "faceVarying")',
        'float[] primvars:p = [] (interpolation = "constant")',
        'float[] primvars:p = [1, 2] (interpolation = "uniform")\nint[] primvars:p:indices = [0, 2]',
        'float[] primvars:p = [1, 2] (interpolation = "uniform")\nint[] primvars:p:indices = [0, -1]',
        'float[] primvars:p = [1, 2] (interpolation = "uniform")\nint[] primvars:p:indices = [0]',
        'float[] primvars:p = [1, 2, 3] (\n interpolation = "uniform"\n elementSize = 2\n)',
        'float[] primvars:p = [1, 2, 3, 4, 5] (\n interpolation = "constant"\n elementSize = 5\n)',
    ],
)
def test_what_does_not_fit_is_told(text: str) -> None:
    found, codes = primvars_of(reader(1) + quads(text))
    assert found == ()
    assert codes == {"invalid-primvar", "primvar-missing"}


def test_too_few_numbers() -> None:
    found, codes = primvars_of(reader(3) + quads('float2[] primvars:p = [(1, 2)] (interpolation = "constant")'))
    assert (found, codes) == ((), {"invalid-primvar"})


@pytest.mark.conforms("PrimvarsAPI.elementSize")
def test_element_size_makes_vectors() -> None:
    text = 'float[] primvars:p = [1, 2, 3, 4, 5, 6] (\n interpolation = "uniform"\n elementSize = 3\n)'
    [found], codes = primvars_of(reader(3) + quads(text))
    assert (found.values.tolist(), codes) == ([[1, 2, 3]] * 2 + [[4, 5, 6]] * 2, set())
    indexed = text + "\nint[] primvars:p:indices = [1, 0]"
    assert primvars_of(reader(3) + quads(indexed))[0][0].values.tolist() == [[4, 5, 6]] * 2 + [[1, 2, 3]] * 2


def test_an_element_size_that_only_others_fit_is_ignored() -> None:
    text = 'float[] primvars:p = [1, 2, 3, 4, 5, 6, 7, 8] (\n interpolation = "faceVarying"\n elementSize = 4\n)'
    [found], codes = primvars_of(reader(1) + quads(text))
    assert codes == {"invalid-primvar"}
    plain = text.replace("elementSize = 4", "elementSize = 1")
    [expected], _ = primvars_of(reader(1) + quads(plain))
    assert found.values.tolist() == expected.values.tolist()


def test_values_that_are_not_finite_are_zero() -> None:
    [found], codes = primvars_of(reader(1) + quads('float[] primvars:p = [nan, 2] (interpolation = "uniform")'))
    assert (found.values.ravel().tolist(), codes) == ([0, 0, 2, 2], {"invalid-primvar"})


def test_time_samples() -> None:
    text = reader(1) + quads("float[] primvars:p.timeSamples = { 1: [0, 1], 3: [2, 3] }\n", "")
    text = text.replace("primvars:p.timeSamples", 'primvars:p (interpolation = "uniform")\n    float[] primvars:p.timeSamples')
    for time, expected in ((2.0, [1, 1, 2, 2]), (None, [0, 0, 1, 1])):
        description, _ = translate_text(text, RenderSettings(time_code=time))
        assert only_mesh(description).primvars[0].values.ravel().tolist() == expected


def test_only_what_is_read_is_kept() -> None:
    text = 'float[] primvars:p = [1] (interpolation = "constant")\nfloat[] primvars:q = [1] (interpolation = "constant")'
    assert [p.name for p in primvars_of(reader(1) + quads(text))[0]] == ["p"]


def test_a_missing_primvar_is_the_readers_fallback() -> None:
    description, found = translate_text(reader(1, default="float inputs:fallback = 0.25") + quads(""))
    assert dict(description.surfaces[0].inputs)["roughness"] == PrimvarInput("p", (0.25,))
    assert ("primvar-missing", "/mesh") in found
    assert only_mesh(description).primvars == ()


def test_points_that_are_split_take_their_primvars_along() -> None:
    """Six points for two triangles and normals per point: the seam's mesh then has its points in corners' order."""
    text = """
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [5, 4, 3, 2, 1, 0]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1)]
    normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)] (interpolation = "vertex")
    float[] primvars:p = [0, 1, 2, 3, 4, 5] (interpolation = "vertex")
    rel material:binding = </m>
"""
    description, _ = translate_text(reader(1) + f'def Mesh "mesh" (prepend apiSchemas = ["MaterialBindingAPI"])\n{{{text}}}')
    mesh = only_mesh(description)
    [found] = mesh.primvars
    assert found.interpolation is Interpolation.POINT
    assert found.values.ravel()[mesh.triangles].tolist() == [[5, 4, 3], [2, 1, 0]]


@pytest.mark.conforms("PrimvarsAPI.primvars:NAME")
def test_constant_ones_are_inherited_and_the_nearest_wins() -> None:
    def tree(inner: str) -> str:
        return f"""
def Xform "a"
{{
    float[] primvars:p = [1] (interpolation = "constant")
    float[] primvars:unread = [1] (interpolation = "constant")
    def Xform "b"
    {{
        {inner}
        {quads("").strip()}
    }}
}}
"""

    for inner, expected in (
        ("", [1]),
        ('float[] primvars:p = [2] (interpolation = "constant")', [2]),
        ('float[] primvars:p = None (interpolation = "vertex")', [1]),  # without a value it is none
        ('float[] primvars:p = [2] (interpolation = "vertex")', []),  # which is not handed down, and ends the search
        ('string[] primvars:p = ["x"] (interpolation = "constant")', []),
    ):
        found, _ = primvars_of(reader(1) + tree(inner))
        assert [(p.interpolation, *p.values.ravel()) for p in found] == [(Interpolation.CONSTANT, p) for p in expected], inner


def test_colours_that_vary_hide_the_one_above() -> None:
    colors = 'color3f[] primvars:displayColor = [(0, 1, 0), (0, 0, 1)] (interpolation = "uniform")'
    above = 'def Xform "a"\n{\ncolor3f[] primvars:displayColor = [(1, 0, 0)]\n'
    description, _ = translate_text(above + quads(colors) + "}\n")
    found = only_mesh(description).colors
    assert found is not None
    assert {tuple(row) for row in found.reshape(-1, 3).tolist()} == {(0, 1, 0), (0, 0, 1)}


def test_native_instances_hand_constant_ones_into_their_prototype() -> None:
    """Instances that differ in what a material reads are apart; those that differ in anything else share one prototype."""

    def instance(name: str, p: int, unread: int) -> str:
        return f"""
def Xform "{name}" (
    instanceable = true
    references = </source>
)
{{
    float[] primvars:p = [{p}] (interpolation = "constant")
    float[] primvars:unread = [{unread}] (interpolation = "constant")
}}
"""

    text = reader(1) + f'class Xform "source"\n{{\n{quads("")}\n}}\n'
    description, _ = translate_text(text + instance("a", 1, 1) + instance("b", 2, 2) + instance("c", 2, 3))
    values = {tuple(s.primvars[0].values.ravel()) for s in description.shapes if isinstance(s, Mesh)}
    assert values == {(1.0,), (2.0,)}
    assert len(description.shapes) == 2


def test_a_sphere_takes_constant_ones() -> None:
    text = (
        reader(1)
        + """
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
    float[] primvars:p = [%s] (interpolation = "%s")
}
"""
    )
    description, found = translate_text(text % ("3", "constant"))
    [ball] = description.shapes
    assert isinstance(ball, Sphere)
    assert [(p.name, p.interpolation, p.values.tolist()) for p in ball.primvars] == [("p", Interpolation.CONSTANT, [[3]])]
    description, found = translate_text(text % ("3, 4", "vertex"))
    assert description.shapes[0].primvars == ()
    assert ("invalid-primvar", "/ball") in found


def test_cages_keep_interpolations_and_indices() -> None:
    """Varying differs from vertex under subdivision, and equal indices of corners mean one point of the surface."""
    text = """
    float[] primvars:constant = [1] (interpolation = "constant")
    float[] primvars:uniform = [1, 2] (interpolation = "uniform")
    float[] primvars:vertex = [0, 1, 2, 3, 4, 5] (interpolation = "vertex")
    float[] primvars:varying = [0, 1] (interpolation = "varying")
    int[] primvars:varying:indices = [0, 0, 0, 1, 1, 1]
    float[] primvars:faceVarying = [5, 6] (interpolation = "faceVarying")
    int[] primvars:faceVarying:indices = [0, 0, 1, 1, 0, 0, 1, 1]
"""
    names = ("constant", "uniform", "vertex", "varying", "faceVarying")
    stage = stage_of(reader(1) + quads(text).replace('"none"', '"catmullClark"'))
    resolved, cage, ctx = resolved_cage(stage, "/mesh")
    surface = translate(stage, RenderSettings())[0].surfaces[0]
    read = [(f"f{i}", PrimvarInput(name, (0.0,))) for i, name in enumerate(names)]
    found = cage_primvars(resolved, [replace(surface, inputs=tuple(read))], cage, ctx)
    kinds = [Interpolation.CONSTANT, Interpolation.FACE, Interpolation.POINT, Interpolation.VARYING, Interpolation.CORNER]
    assert [p.interpolation for p in found] == kinds
    assert found[3].values.ravel().tolist() == [0, 0, 0, 1, 1, 1]
    assert found[4].values.ravel().tolist() == [5, 6]
    assert found[4].indices is not None
    assert found[4].indices.tolist() == [0, 0, 1, 1, 0, 0, 1, 1]


INSTANCER = """
def PointInstancer "points"
{
    %s
    int[] protoIndices = [0, 1, 0, 0]
    point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]
    rel prototypes = [</points/a>, </points/b>]
    def Sphere "a"
    {
        %s
    }
    def Cube "b"
    {
    }
}
"""


def rows(description: SceneDescription) -> dict[str, list[list[Any]]]:
    """Values of the placements' primvars, by prototype."""
    return {
        f"{description.prototypes[placement.prototype].path} {p.name}": p.values.tolist()
        for placement in description.placements
        for p in placement.primvars
    }


@pytest.mark.conforms("Gprim.primvars:displayColor")
def test_display_color_of_instances() -> None:
    """In the order of each prototype's instances; the sphere shows it by a primvar input."""
    text = 'color3f[] primvars:displayColor = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)] (interpolation = "vertex")'
    description, found = translate_text(INSTANCER % (text, ""))
    assert rows(description) == {
        "/points/a displayColor": [[0, 0, 0], [2, 0, 0], [3, 0, 0]],
        "/points/b displayColor": [[1, 0, 0]],
    }
    assert {s.inputs for s in description.surfaces} == {(("diffuse_color", PrimvarInput("displayColor", (0.18, 0.18, 0.18))),)}
    assert {code for code, _ in found} <= {"default-light", "camera-automatic"}


def test_masked_instances_leave_no_row() -> None:
    text = """
    float[] primvars:displayOpacity = [0, 0.25, 0.5, 0.75] (interpolation = "varying")
    int64[] ids = [10, 11, 12, 13]
    int64[] invisibleIds = [12]
"""
    description, _ = translate_text((INSTANCER % (text, "")).replace('"points"\n', '"points" (\n inactiveIds = [10]\n)\n', 1))
    assert rows(description) == {"/points/a displayOpacity": [[0.75]], "/points/b displayOpacity": [[0.25]]}
    opacity = ("opacity", PrimvarInput("displayOpacity", (1.0,)))
    assert {(s.inputs, s.presence, s.thin) for s in description.surfaces} == {((opacity,), True, True)}


def test_what_the_prototype_has_itself_is_nearer() -> None:
    text = 'color3f[] primvars:displayColor = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)] (interpolation = "vertex")'
    own = 'color3f[] primvars:displayColor = [(0, 1, 0)] (interpolation = "constant")'
    description, _ = translate_text(INSTANCER % (text, own))
    assert sorted(rows(description)) == ["/points/b displayColor"]
    assert (0, 1, 0) in {s.diffuse_color for s in description.surfaces if not s.inputs}


def test_what_the_instancer_has_is_nearer_than_what_it_inherits() -> None:
    text = 'float[] primvars:p = [5, 6, 7, 8] (interpolation = "faceVarying")'
    bound = "rel material:binding = </m>"
    instancer = (INSTANCER % (text, bound)).replace('Sphere "a"', 'Sphere "a" (prepend apiSchemas = ["MaterialBindingAPI"])')
    outer = f'def Xform "outer"\n{{\n float[] primvars:p = [1] (interpolation = "constant")\n{instancer}\n}}\n'
    description, found = translate_text(reader(1) + outer.replace("</points", "</outer/points"))
    assert rows(description) == {"/outer/points/a p": [[5], [7], [8]]}
    assert all(s.primvars == () for s in description.shapes)
    assert "primvar-missing" not in {code for code, _ in found}


COLOR = 'primvars:displayColor = %s (\n interpolation = "%s"\n elementSize = %d\n)'
THREES = "float[] " + COLOR % ([0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3], "vertex", 3)
INDEXED = (
    "color3f[] " + COLOR % ("[(7, 7, 7), (8, 8, 8)]", "vertex", 1) + "\nint[] primvars:displayColor:indices = [0, 1, 1, 0]"
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("color3f[] " + COLOR % ("[(4, 5, 6)]", "uniform", 1), [[4, 5, 6]] * 3),
        (THREES, [[0, 0, 0], [2, 2, 2], [3, 3, 3]]),
        (INDEXED, [[7, 7, 7], [8, 8, 8], [7, 7, 7]]),
    ],
)
def test_how_instancers_author_them(text: str, expected: list[list[float]]) -> None:
    assert rows(translate_text(INSTANCER % (text, ""))[0])["/points/a displayColor"] == expected


def test_the_instancers_own_color_is_nearer_than_the_one_it_inherits() -> None:
    own = 'color3f[] primvars:displayColor = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)] (interpolation = "vertex")'
    outer = 'color3f[] primvars:displayColor = [(0, 1, 0)] (interpolation = "constant")'
    text = f'def Xform "outer"\n{{\n{outer}\n{INSTANCER % (own, "")}\n}}\n'.replace("</points", "</outer/points")
    assert sorted(rows(translate_text(text)[0])) == ["/outer/points/a displayColor", "/outer/points/b displayColor"]


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ('color3f[] primvars:displayColor = [(4, 5, 6)] (interpolation = "vertex")', "invalid-primvar"),
        ('float2[] primvars:displayColor = [(0, 0), (0, 0), (0, 0), (0, 0)] (interpolation = "vertex")', "instance-primvar"),
    ],
)
def test_what_does_not_fit_the_instances(text: str, code: str) -> None:
    description, found = translate_text(INSTANCER % (text, ""))
    assert (rows(description), (code, "/points") in found) == ({}, True)


def test_constant_ones_of_instancers_color_their_prototypes() -> None:
    description, _ = translate_text(
        INSTANCER % ('color3f[] primvars:displayColor = [(0.25, 0.5, 0.75)] (interpolation = "constant")', "")
    )
    assert ({s.diffuse_color for s in description.surfaces}, rows(description)) == ({(0.25, 0.5, 0.75)}, {})


def test_a_single_instance_keeps_its_color() -> None:
    color = 'color3f[] primvars:displayColor = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)] (interpolation = "vertex")'
    description, _ = translate_text(INSTANCER % (f"{color}\n int64[] invisibleIds = [1, 2, 3]", ""))
    assert rows(description) == {"/points/a displayColor": [[0, 0, 0]]}


def test_nested_instancers_hand_down_the_outer_ones_values() -> None:
    text = """
def PointInstancer "outer"
{
    color3f[] primvars:displayColor = [(1, 0, 0), (2, 0, 0)] (interpolation = "vertex")
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (9, 0, 0)]
    rel prototypes = </outer/inner>
    def PointInstancer "inner"
    {
        int[] protoIndices = [0, 0, 0]
        point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
        rel prototypes = </outer/inner/ball>
        def Sphere "ball"
        {
        }
    }
}
"""
    description, _ = translate_text(text)
    colors = {"/outer/inner/ball displayColor": [[1, 0, 0]] * 3 + [[2, 0, 0]] * 3}
    assert rows(description) == colors
    inner = 'float[] primvars:displayOpacity = [0, 0.5, 1] (interpolation = "vertex")'
    description, _ = translate_text(text.replace("int[] protoIndices = [0, 0, 0]", f"{inner}\n int[] protoIndices = [0, 0, 0]"))
    assert rows(description) == colors | {"/outer/inner/ball displayOpacity": [[0], [0.5], [1]] * 2}


@pytest.mark.conforms("Gprim.primvars:displayOpacity")
def test_display_opacity_without_a_material() -> None:
    """A Lambert surface that is there in part; what varies is an input."""
    ball = 'def Sphere "ball"\n{\n float[] primvars:displayOpacity = [%s]\n}\n'
    for value, opacity, presence in (("0.25", 0.25, True), ("1", 1, False), ("1.5", 1, False), ("-1", 0, True)):
        [surface] = translate_text(ball % value)[0].surfaces
        assert (surface.lambert, surface.opacity, surface.presence, surface.thin) == (True, opacity, presence, presence)
    description, _ = translate_text(quads('float[] primvars:displayOpacity = [0, 1] (interpolation = "uniform")'))
    assert dict(description.surfaces[0].inputs) == {"opacity": PrimvarInput("displayOpacity", (1.0,))}
    assert only_mesh(description).primvars[0].values.ravel().tolist() == [0, 0, 1, 1]
