"""Edits for a render change the prims that they are for alone: a stage with arcs is drawn as one with the prims written out."""

from __future__ import annotations

import pytest
from tests.translation.describe import describe

from primray.settings import RenderSettings
from primray.usd import translate

from ..skinned_text import API, character, placed, skin
from ..usd_text import stage_of

ARCS = ("references", "inherits", "specializes", "payload")
MOVED = 'double3 xformOp:translate = (3, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n'
CAMERA = 'def Camera "eye" (prepend apiSchemas = ["BackPlateAPI:sky"])\n{\nBODY}\n'
PLATE = "float focusDistance = 60\nfloat2 clippingRange = (0.01, 1000)\n"
LEVELS = 'def Sphere "fine"\n{\n}\ndef Cube "coarse"\n{\n}\n'
LOD = 'prepend apiSchemas = ["LODRootAPI"]'


def drawn(text: str, **settings: object) -> str:
    asked = {"resolution": (8, 8), "time_code": 4.0} | settings
    description, _ = translate(stage_of(text), RenderSettings(**asked))  # type: ignore[arg-type]
    return describe(description, [], "no file")


def render_pass(body: str) -> str:
    return f'def RenderPass "pass"\n{{\n{body}\n}}\n'


@pytest.mark.parametrize("arc", ARCS)
def test_a_root_that_others_compose_is_posed_once(arc: str) -> None:
    first = placed("def SkelRoot", "a", character())
    found = first + placed("def SkelRoot", "b", MOVED, header=f"{API}\n{arc} = </a>")
    assert drawn(found) == drawn(first + placed("def SkelRoot", "b", MOVED + character(), header=API))


@pytest.mark.parametrize("arc", ARCS)
def test_a_mesh_outside_that_composes_a_posed_one_is_as_authored(arc: str) -> None:
    first = placed("def SkelRoot", "a", character())
    outside = f'def Mesh "skin" (\n{arc} = </a/skin>\n)\n{{\n{MOVED}}}\n'
    assert drawn(first + outside) == drawn(first + skin(MOVED + "rel skel:skeleton = </a/bones>"))


def test_a_mesh_of_the_same_root_that_composes_a_posed_one_is_posed_once() -> None:
    second = placed("def Mesh", "twin", MOVED, header=f"{API}\nreferences = </a/skin>")
    by_hand = skin(MOVED + "rel skel:skeleton = <../bones>").replace('"skin"', '"twin"')
    assert drawn(placed("def SkelRoot", "a", character() + second)) == drawn(placed("def SkelRoot", "a", character() + by_hand))


def test_the_transform_held_for_a_pose_stays_in_its_group() -> None:
    """With a layer offset the group that refers to the posed one is elsewhere at the same time."""
    sway = "double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 10: (10, 0, 0)}\n"
    sway += 'uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    group = placed("def Xform", "g", sway + placed("def SkelRoot", "a", character()) + 'def Cube "stone"\n{\n}\n')
    later = 'def Xform "h" (\nreferences = </g> (offset = 2)\n)\n{\n}\n'
    shifted = group.replace('"g"', '"h"').replace("0: (", "2: (").replace("0: [", "2: [")
    assert "2: (0, 0, 0), 12: (10, 0, 0)" in shifted
    assert drawn(group + later) == drawn(group + shifted)


@pytest.mark.parametrize("arc", ARCS)
@pytest.mark.parametrize(
    "body",
    [
        "rel collection:matte:includes = </a>",
        "rel collection:prune:includes = </a>",
        "rel collection:renderVisibility:excludes = </a>",
        "rel collection:cameraVisibility:excludes = </a>",
    ],
)
def test_a_pass_reaches_what_its_collections_hold(arc: str, body: str) -> None:
    cube = 'def Cube "a"\n{\ndouble size = 1\n}\n'
    found = cube + f'def Cube "b" (\n{arc} = </a>\n)\n{{\n{MOVED}}}\n'
    by_hand = cube + f'def Cube "b"\n{{\ndouble size = 1\n{MOVED}}}\n'
    asked = {"render_pass": "/pass"}
    assert drawn(found + render_pass(body), **asked) == drawn(by_hand + render_pass(body), **asked)


@pytest.mark.parametrize("arc", ARCS)
def test_the_plate_of_one_camera_is_not_drawn_for_another(arc: str) -> None:
    first = CAMERA.replace("BODY", PLATE)
    second = f'def Camera "other" (\n{arc} = </eye>\n)\n{{\n{MOVED}}}\n'
    by_hand = CAMERA.replace("BODY", PLATE + MOVED).replace('"eye"', '"other"')
    assert drawn(first + second, camera="/eye") == drawn(first + by_hand, camera="/eye")


def test_a_camera_that_is_an_instance_has_its_plate() -> None:
    lens = CAMERA.replace("BODY", PLATE).replace("def Camera", "class Camera").replace('"eye"', '"lens"')
    found = lens + 'def Camera "eye" (\ninstanceable = true\nreferences = </lens>\n)\n{\n}\n'
    assert drawn(found) == drawn(CAMERA.replace("BODY", PLATE))


@pytest.mark.parametrize("arc", ARCS)
def test_a_geometry_light_lights_what_it_names(arc: str) -> None:
    cube = 'def Cube "a"\n{\ndouble size = 1\n}\ndef GeometryLight "lamp"\n{\nrel geometry = </a>\n}\n'
    found = cube + f'def Cube "b" (\n{arc} = </a>\n)\n{{\n{MOVED}}}\n'
    assert drawn(found) == drawn(cube + f'def Cube "b"\n{{\ndouble size = 1\n{MOVED}}}\n')


@pytest.mark.parametrize("arc", ARCS)
def test_a_level_of_one_root_is_not_taken_from_another(arc: str) -> None:
    one = f'def Xform "a" (\n{LOD}\n)\n{{\nint lod:default:index = 0\n{LEVELS}}}\n'
    found = one + f'def Xform "b" (\n{arc} = </a>\n)\n{{\nint lod:default:index = 1\n}}\n'
    by_hand = f'def Xform "b" (\n{LOD}\n)\n{{\nint lod:default:index = 1\n{LEVELS}}}\n'
    assert drawn(found) == drawn(one + by_hand)


TREE = f"""class "tree"
{{
    def SkelRoot "char"
    {{
        {character()}
    }}
    def Xform "crown" (
        {LOD}
    )
    {{
        {LEVELS}
    }}
    def Cube "trunk"
    {{
        double size = 1
    }}
}}
"""
IGNORED = """over "char"
{
    over "wave"
    {
        float3[] translations = [(9, 9, 9), (9, 9, 9)]
    }
    def Sphere "stray"
    {
    }
}
over "crown"
{
    int lod:default:index = 1
}
over "trunk"
{
    double size = 7
}
"""


@pytest.mark.parametrize(
    "more",
    [
        "",
        render_pass("rel collection:prune:includes = </one/trunk>"),
        render_pass("rel collection:matte:includes = </one/crown>"),
        render_pass("rel collection:renderVisibility:excludes = </one/char>"),
        render_pass("rel collection:cameraVisibility:excludes = </one/char/skin>"),
        'def GeometryLight "lamp"\n{\nrel geometry = </one/trunk>\n}\n',
    ],
)
@pytest.mark.parametrize("around", [False, True])
def test_opinions_below_instances_count_for_nothing(more: str, around: bool) -> None:
    """Also where they are authored below what the instance's parent refers to."""

    def stage(over: str) -> str:
        head = "instanceable = true\nreferences = </tree>"
        two = placed("def Xform", "two", "", 5, head)
        if not around:
            return TREE + placed("def Xform", "one", over, 0, head) + two + more
        wrapped = placed("class", "set", placed("def Xform", "in", over, 0, head))
        named = more.replace("/one/", "/one/in/")
        return TREE + wrapped + placed("def Xform", "one", "", 0, "references = </set>") + two + named

    asked = {"render_pass": "/pass"} if "RenderPass" in more else {}
    assert drawn(stage(IGNORED), **asked) == drawn(stage(""), **asked)


MODEL = 'def Xform "%s" (\nkind = "component"\n)\n{\nuniform token model:drawMode = "bounds"\ndef Cube "c"\n{\n}\n}\n'


@pytest.mark.parametrize("around", ["kind", "scope"])
@pytest.mark.parametrize(
    ("others", "settings"),
    [
        ('def Cube "d"\n{\n}\n', {"render_pass": "/pass"}),
        (placed("def SkelRoot", "d", character()), {}),
        (placed("def Xform", "d", LEVELS, header=LOD), {}),
    ],
    ids=["pass", "skeleton", "levels"],
)
def test_models_of_an_instance_stay_models_when_it_ends(others: str, settings: dict[str, str], around: str) -> None:
    """USD takes the root of an instance for a group of models, which is none in the world."""
    kind = placed("over", "kind", MODEL % "m" + others)
    scope = placed("over", "scope", placed("def Xform", "in", "", header="instanceable = true\nreferences = </kind>"))
    instance = placed("def Xform", "a", MOVED, header=f"instanceable = true\nreferences = </{around}>")
    prune = render_pass("rel collection:prune:includes = </a/%sd>" % ("in/" if around == "scope" else ""))
    description, _ = translate(stage_of(kind + scope + instance + prune), RenderSettings(**settings))  # type: ignore[arg-type]
    paths = {shape.path.removeprefix("/a/").removeprefix("in/") for shape in description.shapes}
    assert "m" in paths
    assert "m/c" not in paths
