"""Point instancers as they may be authored: each stage's triangles are those that USD's own functions give."""

from __future__ import annotations

import sys

import pytest
from pxr import Usd
from tests.expanded import assert_same_triangles, flat_stage, world_triangles

from primray.description import LightType, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of, translate_text

BALL = '    def Sphere "ball"\n    {\n    }\n'


def instancer(attributes: str, inside: str = BALL, prototypes: str = "</p/ball>", name: str = "p") -> str:
    lines = "".join(f"    {line.strip()}\n" for line in attributes.strip().splitlines())
    return f'def PointInstancer "{name}"\n{{\n    rel prototypes = {prototypes}\n{lines}{inside}}}\n'


THREE = """int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0)]"""
BOTH = "[</p/a>, </p/b>]"


def two(a: str, b: str = "") -> str:
    return f'    def Sphere "a"{a}\n    {{\n    }}\n    def Cube "b"\n    {{\n{b}    }}\n'


MIXED = "int[] protoIndices = [0, 1, 0, 1]\npoint3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0), (9, 1, 0)]"

# name: stage, time codes, how many shapes stand in the world at each
CASES: dict[str, tuple[str, list[float | None], list[int]]] = {
    "scales of any sign and zero": (
        instancer(THREE + "\nfloat3[] scales = [(-1, 2, 3), (0, 1, 1), (1e-6, -1e6, 0)]"), [None], [3]),
    "orientations of any length": (
        instancer(THREE + "\nquath[] orientations = [(2, 0, 0, 0), (0, 0, 0, 0), (0.3, 0.1, 0.2, 0.5)]"), [None], [3]),
    "orientationsf wins": (
        instancer(THREE + "\nquath[] orientations = [(0, 1, 0, 0), (0, 1, 0, 0), (0, 1, 0, 0)]"
                  "\nquatf[] orientationsf = [(0.6, 0.8, 0, 0), (0.6, 0, 0.8, 0), (1, 2, 3, 4)]"), [None], [3]),
    "empty": (instancer("int[] protoIndices = []\npoint3f[] positions = []"), [None], [0]),
    "no prototypes": (instancer(THREE, prototypes="[]"), [None], [0]),
    "indices out of range": (
        instancer("int[] protoIndices = [0, 7, -1]\npoint3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0)]"), [None], [1]),
    "ids twice, absent ones": (
        instancer(THREE + "\nint64[] ids = [5, 5, 9]\nint64[] invisibleIds = [5, 77]"), [None], [1]),
    "invisibleIds without ids": (instancer(THREE + "\nint64[] invisibleIds = [1, 44]"), [None], [2]),
    "animated, of unequal lengths": (
        instancer("""int[] protoIndices.timeSamples = { 1: [0], 5: [0, 0, 0] }
            point3f[] positions.timeSamples = { 1: [(0, 0, 0)], 5: [(0, 1, 0), (3, 0, 0), (6, 0, 0)] }"""),
        [1.0, 3.0, 5.0, 9.0], [1, 1, 3, 3]),
    "animated positions and orientations": (
        instancer("""int[] protoIndices = [0, 0]
            point3f[] positions.timeSamples = { 1: [(0, 0, 0), (2, 0, 0)], 5: [(0, 1, 0), (3, 4, 0)] }
            quatf[] orientationsf.timeSamples = { 1: [(1, 0, 0, 0), (1, 0, 0, 0)], 5: [(0, 1, 0, 0), (0.6, 0, 0.8, 0)] }"""),
        [1.0, 5.0, 9.0], [2, 2, 2]),
    "animated invisibleIds": (
        instancer(THREE + "\nint64[] invisibleIds.timeSamples = { 1: [0, 1], 5: [] }"), [1.0, 5.0], [1, 3]),
    "an invisible prototype": (
        instancer(MIXED, two("", '        token visibility = "invisible"\n'), BOTH), [None], [2]),
    "a guide among the prototypes": (
        instancer(MIXED, two("", '        uniform token purpose = "guide"\n'), BOTH), [None], [2]),
    "an inactive prototype": (
        instancer(MIXED, two(" (\n        active = false\n    )"), BOTH), [None], [2]),
    "prototypes outside, under an over": (
        instancer(THREE, "", "</lib/ball>") + 'over "lib"\n{\n' + BALL + "}\n", [None], [3]),
    "a prototype that is also drawn by itself": (
        instancer(THREE, "", "</lib/ball>") + 'def "lib"\n{\n' + BALL + "}\n", [None], [4]),
    "an instancer as prototype of itself's sibling": (
        instancer(THREE, "", "</q>") + instancer(THREE, prototypes="</q/ball>", name="q"), [None], [12]),
}  # fmt: skip


def shapes(d: SceneDescription) -> int:
    """How often shapes stand in the world, without USD's tessellation counting."""
    return len(d.static) + sum(len(p) * len(d.prototypes[p.prototype].shapes) for p in d.placements)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.conforms(
    "PointInstancer.prototypes",
    "PointInstancer.protoIndices",
    "PointInstancer.positions",
    "PointInstancer.orientations",
    "PointInstancer.orientationsf",
    "PointInstancer.scales",
    "PointInstancer.ids",
    "PointInstancer.invisibleIds",
)
def test_case(name: str) -> None:
    text, times, counts = CASES[name]
    stage = stage_of(text)
    for code, count in zip(times, counts, strict=True):
        description, _ = translate(stage, RenderSettings(time_code=code))
        time = Usd.TimeCode.Default() if code is None else Usd.TimeCode(code)
        flat, _ = translate(flat_stage(stage, time), RenderSettings())
        assert shapes(description) == shapes(flat) == count
        assert_same_triangles(world_triangles(description), world_triangles(flat), 1e-13)


def test_a_prototype_with_a_root_transform_and_a_parent_that_is_moved() -> None:
    """The root's own transform counts, its ancestors' do not (UsdGeomPointInstancer)."""
    moved = '        double3 xformOp:translate = (0, 5, 0)\n        uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    inside = f'    def Xform "x"\n    {{\n{moved}        def Cube "b"\n        {{\n{moved}        }}\n    }}\n'
    stage = stage_of(instancer(THREE, inside, "</p/x/b>"))
    description, _ = translate(stage, RenderSettings())
    expected = translate(flat_stage(stage, Usd.TimeCode.Default()), RenderSettings())[0]
    assert_same_triangles(world_triangles(description), world_triangles(expected), 1e-13)
    assert world_triangles(description)[..., 1].max() == 6.0


@pytest.mark.parametrize("absent", ["int[] protoIndices", "point3f[] positions"])
def test_an_instancer_without_positions_or_indices_is_told(absent: str) -> None:
    text = instancer(THREE, '    def Xform "x"\n    {\n        def Cube "b"\n        {\n        }\n    }\n', "</p/x>")
    assert "invalid-instancer" not in {code for code, _ in translate_text(text)[1]}
    kept = "\n".join(line for line in text.splitlines() if absent not in line)
    assert kept != text.rstrip("\n")
    assert [code for code, _ in translate_text(kept)[1]].count("invalid-instancer") == 1


def test_an_instancer_that_contains_itself_ends() -> None:
    inner = '    def Xform "x"\n    {\n        def PointInstancer "q"\n        {\n            rel prototypes = </p>\n'
    inner += "            int[] protoIndices = [0]\n            point3f[] positions = [(1, 0, 0)]\n        }\n    }\n"
    _, found = translate_text(instancer(THREE, inner, "</p/x>"))
    assert "invalid-instancer" in {code for code, _ in found}


def test_lights_inside_instancers_stand_where_their_instances_do() -> None:
    lamp = '    def Xform "lamp"\n    {\n        def SphereLight "bulb"\n        {\n'
    lamp += (
        '            double3 xformOp:translate = (0, 2, 0)\n            uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    )
    lamp += "        }\n    }\n"
    description, _ = translate_text(
        instancer(THREE + "\nfloat3[] scales = [(1, 1, 1), (2, 2, 2), (1, -1, 1)]", lamp, "</p/lamp>")
    )
    assert {light.type for light in description.lights} == {LightType.SPHERE}
    assert [light.world_from_light[:3, 3].tolist() for light in description.lights] == [[0, 2, 0], [3, 4, 0], [6, -2, 0]]


def test_of_many_lights_the_first_are_lit_and_one_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["primray.usd.lights.assembly"], "MAX_LIGHT_INSTANCES", 1000)
    lamp = '    def SphereLight "bulb"\n    {\n    }\n'
    count = 1500
    arrays = f"int[] protoIndices = {[0] * count}\npoint3f[] positions = {[(float(i), 0.0, 0.0) for i in range(count)]}"
    description, found = translate_text(instancer(arrays, lamp, "</p/bulb>"))
    assert len(description.lights) == 1000
    assert ("instanced-lights", "/p/bulb") in found
