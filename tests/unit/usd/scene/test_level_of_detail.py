"""UsdLod: one level of detail of each root is drawn, by override, heuristics or default, each instance by its own place."""

from __future__ import annotations

import pytest

from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

HEAD = """def Camera "camera"
{
    double3 xformOp:translate = (0, 0, AWAY)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def LODDistanceHeuristic "far"
{
    uniform token lod:domain = "imaging"
    uniform float[] thresholds = [10, 50]
}
def LODScreenSizeHeuristic "small"
{
    uniform token lod:domain = "imaging"
    uniform float[] thresholds = [0.25, 0.01]
}
def LODDistanceHeuristic "loud"
{
    uniform token lod:domain = "audio"
    uniform float[] thresholds = [10000]
}
"""
TREE = """def Xform "tree" (prepend apiSchemas = ["LODRootAPI"])
{
    BODY
    def Sphere "fine"
    {
    }
    def Cube "coarse"
    {
    }
    def Cone "coarsest"
    {
    }
}
"""
BY_DISTANCE = "rel lod:heuristics = </far>"


def drawn(text: str, away: float = 5, **settings: object) -> tuple[list[str], list[str]]:
    """The levels that are drawn, and what is told of the choices."""
    stage = stage_of(HEAD.replace("AWAY", str(away)) + text)
    description, diagnostics = translate(stage, RenderSettings(resolution=(8, 8), **settings))  # type: ignore[arg-type]
    found = sorted(shape.path for shape in description.shapes)
    return [path.removeprefix("/tree/") for path in found], [d.message for d in diagnostics if d.code == "lod-chosen"]


def tree(body: str) -> str:
    return TREE.replace("BODY", body)


@pytest.mark.parametrize(
    ("away", "level"), [(5, "fine"), (9.99, "fine"), (10, "coarse"), (49, "coarse"), (50, "coarsest"), (1000, "coarsest")]
)
def test_by_distance(away: float, level: str) -> None:
    found, told = drawn(tree(BY_DISTANCE), away)
    assert found == [level]
    assert level in told[0]
    assert "/far" in told[0]


def test_by_size_on_the_screen() -> None:
    assert drawn(tree("rel lod:heuristics = </small>"), 4)[0] == ["fine"]
    assert drawn(tree("rel lod:heuristics = </small>"), 20)[0] == ["coarse"]
    assert drawn(tree("rel lod:heuristics = </small>"), 400)[0] == ["coarsest"]


def test_other_domains_and_none_leave_the_default() -> None:
    assert drawn(tree("rel lod:heuristics = </loud>\n    int lod:default:index = 1"))[0] == ["coarse"]
    assert drawn(tree(""))[0] == ["fine"]
    assert drawn(tree("int lod:default:index = 7"))[0] == ["coarsest"]
    assert drawn(tree("rel lod:heuristics = [</loud>, </far>]"), 20)[0] == ["coarse"]


@pytest.mark.parametrize(
    ("override", "found"),
    [
        ('token lod:override:mode = "indexedLOD"\n    float lod:override:index = 2', ["coarsest"]),
        ('token lod:override:mode = "indexedLOD"\n    float lod:override:index = 9', ["coarsest"]),
        ('token lod:override:mode = "noLOD"', []),
        ('token lod:override:mode = "allLOD"', ["coarse", "coarsest", "fine"]),
        ('token lod:override:mode = "noOverride"', ["fine"]),
        ('token lod:override:mode = "inherited"', ["fine"]),
    ],
)
def test_overrides(override: str, found: list[str]) -> None:
    above = f'def Xform "all" (prepend apiSchemas = ["LODOverrideAPI"])\n{{\n    {override}\n{tree(BY_DISTANCE)}}}\n'
    assert [path.removeprefix("/all/tree/") for path in drawn(above)[0]] == found


def test_each_instance_chooses_for_itself() -> None:
    text = 'class "_tree" {\n' + tree(BY_DISTANCE) + "}\n"
    for name, x in (("near", 0), ("further", 30)):
        text += f"""def Xform "{name}" (
    instanceable = true
    references = </_tree>
)
{{
    double3 xformOp:translate = ({x}, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    found, told = drawn(text)
    assert found == ["/further/tree/coarse", "/near/tree/fine"]
    assert len(told) >= 2


def test_levels_within_levels() -> None:
    inner = tree(BY_DISTANCE).replace('"tree"', '"inner"')
    outer = TREE.replace("BODY", BY_DISTANCE).replace('    def Sphere "fine"\n    {\n    }\n', inner)
    assert drawn(outer)[0] == ["inner/fine"]
    assert drawn(outer, 20)[0] == ["coarse"]


def test_without_a_camera_it_is_the_default() -> None:
    stage = stage_of(HEAD.partition("def LOD")[1] + HEAD.partition("def LOD")[2] + tree(BY_DISTANCE))
    description, diagnostics = translate(stage, RenderSettings(resolution=(8, 8)))
    assert [shape.path for shape in description.shapes] == ["/tree/fine"]
    assert any("no camera" in d.message for d in diagnostics if d.code == "lod-chosen")


@pytest.mark.parametrize("how", ["def Scope", "class", "over"])
@pytest.mark.parametrize("in_instance", [False, True])
def test_one_level_of_a_prototype_is_drawn_wherever_it_is(how: str, in_instance: bool) -> None:
    text = 'def PointInstancer "many"\n{\npoint3f[] positions = [(0, 0, 0)]\nint[] protoIndices = [0]\n'
    text += f'rel prototypes = <of/tree>\n{how} "of"\n{{\n{tree("int lod:default:index = 1")}}}\n}}\n'
    if in_instance:
        text = f'class "all"\n{{\n{text}}}\ndef "in" (\ninstanceable = true\nreferences = </all>\n)\n{{\n}}\n'
    found, _ = drawn(text)
    assert found == [f"{'/in' if in_instance else ''}/many/of/tree/coarse"]


def test_classes_that_nothing_draws_have_no_levels_to_choose() -> None:
    inherited = TREE.replace("def Xform", "class", 1).replace('"tree"', '"kind"').replace("BODY", "")
    found, told = drawn(inherited + 'def Xform "tree" (\ninherits = </kind>\n)\n{\nint lod:default:index = 2\n}\n')
    assert found == ["coarsest"]
    assert len(told) == 1


def test_an_invisible_root_has_no_levels_to_choose() -> None:
    assert drawn(tree('token visibility = "invisible"')) == ([], [])


def test_levels_are_chosen_before_the_view_of_the_edited_stage_is_set_up() -> None:
    _, diagnostics = translate(stage_of(HEAD.replace("AWAY", "5") + tree("")), RenderSettings(resolution=(8, 8)))
    assert [d.code for d in diagnostics][:2] == ["lod-chosen", "camera-chosen"]
    assert [d.code for d in diagnostics].count("camera-chosen") == 1


def test_an_instancer_of_a_level_that_is_left_out_is_reported() -> None:
    crowd = 'def PointInstancer "many"\n{\npoint3f[] positions = [(0, 0, 0)]\nint[] protoIndices = [0]\n'
    crowd += "rel prototypes = <LEVEL>\n}\n"
    for level, is_missed in (("/tree/fine", False), ("/tree/coarse", True)):
        stage = stage_of(tree("int lod:default:index = 0") + crowd.replace("LEVEL", level))
        _, diagnostics = translate(stage, RenderSettings(resolution=(8, 8)))
        assert [d.prim_path for d in diagnostics if d.code == "invalid-instancer"] == ["/many"] * is_missed
