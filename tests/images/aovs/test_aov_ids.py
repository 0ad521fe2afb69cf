"""Ids of prims, instances and materials: each against where it stands, and what its number is said to mean."""

from __future__ import annotations

import numpy as np
import pytest
from tests.images.aovs.seen import stage_of
from tests.images.aovs.test_aovs import picture, values

from primray.images.image import Image
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.instancing import instances as arrangement

# Balls of radius 0.2 on whole coordinates, seen from (2, 1, 20) or so: which one is at a point is plain.
NESTED = """
class "_pair"
{
    def PointInstancer "row"
    {
        rel prototypes = [</_pair/row/red>, </_pair/row/two>]
        int[] protoIndices = [0, 1, 0]
        point3f[] positions = [(0, 0, 0), (1, 0, 0), (3, 0, 0)]
        int64[] ids = [10, 11, 12]
        def Sphere "red"
        {
            double radius = 0.2
        }
        def Xform "two"
        {
            def Sphere "low"
            {
                double radius = 0.2
            }
            def Sphere "high"
            {
                double radius = 0.2
                double3 xformOp:translate = (1, 0, 0)
                uniform token[] xformOpOrder = ["xformOp:translate"]
            }
        }
    }
}
def Xform "World"
{
    def Xform "first" (
        instanceable = true
        references = </_pair>
    )
    {
    }
    def Xform "second" (
        instanceable = true
        references = </_pair>
    )
    {
        double3 xformOp:translate = (0, 1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Sphere "alone"
    {
        double radius = 0.2
        double3 xformOp:translate = (4, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""
# By x: the prim where it is defined, and the instance within the pair.
EXPECTED = {
    0: ("/_pair/row/red", "/row[0]"),
    1: ("/_pair/row/two/low", "/row[1]"),
    2: ("/_pair/row/two/high", "/row[1]"),
    3: ("/_pair/row/red", "/row[2]"),
}


def check_nested(image: Image) -> None:
    prim, instance = image.aovs["prim"], image.aovs["instance"]
    assert prim.values.dtype == instance.values.dtype == np.uint32
    at = np.rint(values(image, "position")).astype(int)
    there = values(image, "prim") > 0
    assert np.array_equal(there, np.isfinite(values(image, "depth")))
    seen = set()
    for (x, y, _), p, i in zip(at[there].tolist(), values(image, "prim")[there], values(image, "instance")[there], strict=True):
        if (x, y) == (4, 0):
            assert (prim.ids[int(p)], i) == ("/World/alone", 0)
        else:
            name, own = EXPECTED[x]
            assert prim.ids[int(p)] == name
            assert instance.ids[int(i)] == ("/World/first", "/World/second")[y] + own
        seen.add((x, y))
    assert len(seen) == 9
    assert sorted(instance.ids) == [n for n in np.unique(values(image, "instance")).tolist() if n]


def nested(threads: int = 2) -> Image:
    stage = stage_of(NESTED, (2, 0.5, 7))
    return picture(stage, ("prim", "instance", "position", "depth"), (240, 180), threads=threads)


def test_instances_in_instances() -> None:
    check_nested(nested())


def test_instances_kept_in_two_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    flat = nested()
    monkeypatch.setattr(arrangement._Graph, "grouping", lambda graph, *limits: frozenset({graph.edges[0][0][0]}))
    stage = stage_of(NESTED, (2, 0.5, 7))
    assert any(p.placements for p in translate(stage, RenderSettings(aovs=("instance",)))[0].prototypes)
    kept = nested()
    check_nested(kept)
    assert sorted(kept.aovs["instance"].ids.values()) == sorted(flat.aovs["instance"].ids.values())


def test_ids_do_not_depend_on_threads() -> None:
    one, three = nested(1), nested(3)
    for name in ("prim", "instance"):
        assert np.array_equal(values(one, name), values(three, name))
        assert one.aovs[name].ids == three.aovs[name].ids


def test_hidden_and_singular_instances_keep_the_numbers_of_the_others() -> None:
    text = """
def PointInstancer "many"
{
    rel prototypes = [</many/ball>, </many/box>]
    int[] protoIndices = [0, 1, 0, 1, 0, 0]
    point3f[] positions = [(-2, 0, 0), (-1, 0, 0), (0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)]
    float3[] scales = [(1, 1, 1), (1, 1, 1), (0, 0, 0), (1, 1, 1), (1, 1, 1), (1, 1, 1)]
    int64[] invisibleIds = [3]
    def Sphere "ball"
    {
        double radius = 0.2
    }
    def Cube "box"
    {
        double size = 0.3
    }
}
def Points "dots"
{
    point3f[] points = [(0, -1, 0), (1, -1, 0), (2, -1, 0)]
    float[] widths = [0.4, 0, 0.4]
}
"""
    image = picture(stage_of(text), ("instance", "position", "prim"), (240, 180))
    there = values(image, "prim") > 0
    names = {(-2, 0): "/many[0]", (-1, 0): "/many[1]", (2, 0): "/many[4]", (0, 1): "/many[5]"}
    names |= {(0, -1): "/dots[0]", (2, -1): "/dots[2]"}
    at = np.rint(values(image, "position")[there][:, :2]).astype(int)
    ids = image.aovs["instance"].ids
    found = {(x, y): ids[int(i)] for (x, y), i in zip(at.tolist(), values(image, "instance")[there], strict=True)}
    assert found == names
    assert [d["code"] for d in image.report["diagnostics"]].count("singular-transform") == 1


def test_skewed_instances_are_named_as_well() -> None:
    """A flat one is baked to a shape of its own (skewed.py); it is the same instance all the same."""
    text = """
def PointInstancer "many"
{
    rel prototypes = </many/ball>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(-1, 0, 0), (0, 0, 0), (1, 0, 0)]
    float3[] scales = [(1, 1, 1), (1, 1, 0), (1, 1, 1)]
    def Cube "ball"
    {
        double size = 0.3
    }
}
"""
    image = picture(stage_of(text), ("instance", "position", "prim"), (120, 90))
    there = values(image, "prim") > 0
    x = np.rint(values(image, "position")[there][:, 0]).astype(int)
    ids = image.aovs["instance"].ids
    assert {(k, ids[int(i)]) for k, i in zip(x.tolist(), values(image, "instance")[there], strict=True)} == {
        (-1, "/many[0]"),
        (0, "/many[1]"),
        (1, "/many[2]"),
    }


def test_materials_of_subsets_and_prims_of_one_material() -> None:
    text = """
def Material "blue"
{
    token outputs:surface.connect = </blue/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
def Material "amber"
{
    token outputs:surface.connect = </amber/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
def Mesh "strip" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    point3f[] points = [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 0, 0), (0, 0, 0), (1, 0, 0)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    uniform token subdivisionScheme = "none"
    rel material:binding = </blue>
    def GeomSubset "right" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </amber>
    }
}
def Sphere "ball" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    double radius = 0.5
    double3 xformOp:translate = (0, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </amber>
}
def Cube "plain"
{
    double size = 0.5
    double3 xformOp:translate = (1.5, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    image = picture(stage_of(text), ("material", "prim", "position"), (96, 72))
    assert image.aovs["material"].ids == {1: "/amber", 2: "/blue"}
    assert image.aovs["prim"].ids == {1: "/ball", 2: "/plain", 3: "/strip"}
    prim, x = values(image, "prim"), values(image, "position")[..., 0]
    expected = np.select([prim == 1, (prim == 3) & (x > 0), prim == 3], [1, 1, 2], 0)
    assert np.array_equal(values(image, "material"), expected)
    assert set(np.unique(expected).tolist()) == {0, 1, 2}
