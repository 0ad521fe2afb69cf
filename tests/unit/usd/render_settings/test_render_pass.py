"""RenderPass: what it prunes, hides and renders from, also within instances, and what of it is told."""

from __future__ import annotations

from typing import Any

import pytest
from pxr import Usd

from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.render_settings.render_settings import products
from primray.usd.stage import edits
from primray.usd.stage.edits import end_instance

from ..usd_text import stage_of

SCENE = """def Xform "set"
{
    def Sphere "a"
    {
        def Sphere "inner"
        {
        }
    }
    def Cube "b"
    {
    }
    def SphereLight "lamp"
    {
    }
}
def Xform "tree"
{
    def Sphere "leaf"
    {
    }
    def Cube "trunk"
    {
    }
}
def Xform "one" (
    instanceable = true
    references = </tree>
)
{
}
def Xform "two" (
    instanceable = true
    references = </tree>
)
{
}
def RenderSettings "first"
{
    uniform int2 resolution = (10, 10)
}
def RenderSettings "second"
{
    uniform int2 resolution = (20, 20)
}
def RenderPass "pass"
{
    BODY
}
"""


def rendered(body: str, **settings: Any) -> tuple[list[str], list[str], list[tuple[str, str, str]], Any]:
    """Paths of shapes as users know them, those of lights, and what is told of the pass."""
    stage = stage_of(SCENE.replace("BODY", body))
    before = stage.GetSessionLayer().ExportToString()
    asked = {"resolution": (8, 8), "render_pass": "/pass"} | settings
    description, diagnostics = translate(stage, RenderSettings(**asked))
    assert stage.GetSessionLayer().ExportToString() == before
    shapes = [s.path for s in description.shapes]
    count = dict.fromkeys(shapes, 0)
    for placed in description.static:
        count[shapes[placed.shape]] += 1
    for placement in description.placements:
        for placed in description.prototypes[placement.prototype].shapes:
            count[shapes[placed.shape]] += len(placement)
    told = [(d.code, d.prim_path, d.attribute) for d in diagnostics if d.prim_path == "/pass"]
    found = [f"{path} {n}" for path, n in sorted(count.items())]
    return found, sorted(x.path for x in description.lights if not x.path.startswith("primray:")), told, description


WHOLE = 3 + 2 + 2 + 2  # shapes that stand in the world


def total(found: list[str]) -> int:
    return sum(int(each.rpartition(" ")[2]) for each in found)


def test_an_empty_pass_changes_nothing() -> None:
    found, lights, told, _ = rendered("")
    assert total(found) == WHOLE
    assert lights == ["/set/lamp"]
    assert told == []


@pytest.mark.conforms("RenderPass.collection:prune")
def test_what_is_pruned_is_gone_with_all_below() -> None:
    found, lights, told, _ = rendered("rel collection:prune:includes = [</set/a>, </set/lamp>]")
    assert total(found) == WHOLE - 2
    assert not any(each.startswith("/set/a") for each in found)
    assert lights == []
    assert told == []


def test_pruned_in_one_instance_of_two() -> None:
    found, _, _, _ = rendered("rel collection:prune:includes = </one/leaf>")
    assert total(found) == WHOLE - 1
    whole, _, _, _ = rendered("rel collection:prune:includes = </two>")
    assert total(whole) == WHOLE - 2
    source, _, _, _ = rendered("rel collection:prune:includes = [</tree>, </two/leaf>]")
    assert total(source) == WHOLE - 3  # what refers to it stays
    expression = """uniform pathExpression collection:prune:membershipExpression = "//leaf" """
    everywhere, _, _, _ = rendered(expression)
    assert total(everywhere) == WHOLE - 3


@pytest.mark.conforms("RenderPass.collection:renderVisibility", "RenderPass.collection:renderVisibility:includeRoot")
def test_only_what_is_included_is_visible() -> None:
    body = "uniform bool collection:renderVisibility:includeRoot = 0\n"
    body += "rel collection:renderVisibility:includes = [</set>, </one>]"
    found, lights, told, _ = rendered(body)
    assert total(found) == 3 + 2
    assert lights == ["/set/lamp"]
    assert told == []
    fewer, lights, _, _ = rendered("rel collection:renderVisibility:excludes = [</set/b>, </set/lamp>, </two/trunk>]")
    assert total(fewer) == WHOLE - 2
    assert lights == []


@pytest.mark.conforms("RenderPass.renderSource")
def test_it_renders_from_its_settings() -> None:
    stage = stage_of(SCENE.replace("BODY", "rel renderSource = </second>"))
    asked = RenderSettings(render_pass="/pass")
    assert translate(stage, asked)[0].frame.resolution == (20, 20)
    assert products(stage, asked, Diagnostics())[0].resolution == (20, 20)
    other = RenderSettings(render_pass="/pass", render_settings="/first")
    assert translate(stage, other)[0].frame.resolution == (10, 10)


def sights(description: Any) -> dict[str, set[str]]:
    """What the camera sees of each shape, by path."""
    found: dict[str, set[str]] = {}
    for shape in description.shapes:
        found.setdefault(shape.path, set()).add(description.surfaces[shape.surface].camera.value)
    return found


def test_what_the_camera_does_not_see() -> None:
    body = "rel collection:cameraVisibility:excludes = [</set>, </two/leaf>]"
    found, _lights, told, description = rendered(body)
    assert total(found) == WHOLE
    assert told == []
    assert not description.lights[0].visible_to_camera
    seen = sights(description)
    assert seen["/set/a"] == seen["/set/a/inner"] == seen["/set/b"] == {"hidden"}
    leaves = [seen[path] for path in seen if path.endswith("/leaf")]
    assert {"hidden"} in leaves
    assert {"seen"} in leaves
    assert all(seen[path] == {"seen"} for path in seen if path.endswith("/trunk"))


def test_what_is_matte() -> None:
    found, _, told, description = rendered("rel collection:matte:includes = [</set/a>, </one>]")
    assert total(found) == WHOLE
    assert told == []
    seen = sights(description)
    assert seen["/set/a"] == seen["/set/a/inner"] == {"matte"}
    assert seen["/set/b"] == {"seen"}
    assert sum(sight == {"matte"} for path, sight in seen.items() if path.startswith("/one")) == 2


@pytest.mark.parametrize("said", ['token primray:camera = "elsewhere"', 'token primray:camera = ""', "int primray:camera = 2"])
def test_what_no_pass_has_written_hides_nothing(said: str) -> None:
    stage = stage_of(f'def Sphere "a"\n{{\n    custom {said}\n}}\n')
    description, told = translate(stage, RenderSettings(resolution=(8, 8)))
    assert sights(description) == {"/a": {"seen"}}
    assert [d.attribute for d in told if d.code == "out-of-range"] == ["primray:camera"] * ("elsewhere" in said)


def test_what_a_pass_says_of_jobs_is_told() -> None:
    body = "uniform asset fileName = @x.usda@\n    rel inputPasses = </pass>"
    assert [attribute for _, _, attribute in rendered(body)[2]] == ["fileName", "inputPasses"]


@pytest.mark.parametrize("asked", ["/none", "/set", "pass"])
def test_a_pass_that_is_not_there(asked: str) -> None:
    with pytest.raises(SettingsError, match="/pass") as error:
        translate(stage_of(SCENE.replace("BODY", "")), RenderSettings(render_pass=asked))
    assert error.value.code == "unknown-render-pass"


CUBE = 'def Cube "NAME"\n{\n}\n'
MEMBERS = CUBE.replace("NAME", "kept") + CUBE.replace("NAME", "lost")
ONLY_KEPT = """uniform bool collection:renderVisibility:includeRoot = 0
rel collection:renderVisibility:includes = KEPT
"""


def shown(text: str, body: str) -> tuple[list[str], list[str], list[str]]:
    """Shapes that are drawn, lights, and codes of warnings."""
    stage = stage_of(text + f'def RenderPass "pass"\n{{\n{body}\n}}\n')
    description, diagnostics = translate(stage, RenderSettings(resolution=(8, 8), render_pass="/pass"))
    lights = [light.path for light in description.lights if not light.path.startswith("primray:")]
    return sorted(s.path for s in description.shapes), lights, [d.code for d in diagnostics if d.is_strict]


@pytest.mark.parametrize(
    "parent",
    [
        "def SkelRoot",
        "def RectLight",
        "def DomeLight",
        "def Mesh",
        "def Points",
        "def Volume",
        "def LightFilter",
        "def PortalLight",
        'def Sphere "top" (prepend apiSchemas = ["LightAPI"])',
        'def Camera "top" (prepend apiSchemas = ["LightAPI"])',
        'def "top" (prepend apiSchemas = ["LightAPI"])',
    ],
)
@pytest.mark.parametrize("is_instance", [False, True])
def test_members_stay_whatever_is_above_them(parent: str, is_instance: bool) -> None:
    head = parent if '"top"' in parent else f'{parent} "top"'
    text = f"{head}\n{{\n{MEMBERS}}}\n"
    if is_instance:
        text = f'class "all"\n{{\n{text}}}\ndef Xform "in" (\ninstanceable = true\nreferences = </all>\n)\n{{\n}}\n'
    place = "/in/top" if is_instance else "/top"
    body = ONLY_KEPT.replace("KEPT", f"<{place}/kept>")
    assert shown(text, body) == ([f"{place}/kept"], [], [])


def test_a_model_that_is_no_member_is_not_drawn_as_its_box() -> None:
    model = 'def Xform "model" (\nkind = "component"\nprepend apiSchemas = ["GeomModelAPI"]\n)\n'
    model += '{\nuniform token model:drawMode = "bounds"\n' + MEMBERS + "}\n"
    group = 'def Xform "world" (\nkind = "group"\n)\n{\n' + model + CUBE.replace("NAME", "other") + "}\n"
    for kept, found in (
        ("</world/other>", ["/world/other"]),
        ("</world/model/kept>", []),
        ("</world/model>", ["/world/model"]),
    ):
        assert shown(group, ONLY_KEPT.replace("KEPT", kept))[0] == found


INSTANCER = """def PointInstancer "many"
{
    point3f[] positions = [(0, 0, 0), (5, 0, 0)]
    int[] protoIndices = [0, 1]
    rel prototypes = [</many/of/kept>, </many/of/lost>]
    HOW "of"
    {
        BODY
    }
}
"""


@pytest.mark.parametrize("how", ["def Scope", "class", "over"])
@pytest.mark.parametrize("nested", [False, True])
def test_prototypes_are_reached_wherever_they_are(how: str, nested: bool) -> None:
    body = MEMBERS
    if nested:  # native instances below what keeps the prototypes out of the world
        body = "".join(f'def "{name}" (\ninstanceable = true\nreferences = </source>\n)\n{{\n}}\n' for name in ("kept", "lost"))
    text = INSTANCER.replace("HOW", how).replace("BODY", body) + 'class "source"\n{\ndef Cube "c"\n{\n}\n}\n'
    kept, lost = (f"/many/of/{name}{'/c' if nested else ''}" for name in ("kept", "lost"))
    assert shown(text, f"rel collection:prune:includes = <{lost}>")[0] == [kept]
    assert shown(text, ONLY_KEPT.replace("KEPT", f"<{kept}>"))[0] == [kept]
    assert shown(text, f"rel collection:renderVisibility:excludes = <{lost}>")[0] == [kept]
    assert shown(text, "rel collection:renderVisibility:excludes = </many>")[0] == []
    stage = stage_of(text + f'def RenderPass "pass"\n{{\nrel collection:matte:includes = <{lost}>\n}}\n')
    description, _ = translate(stage, RenderSettings(resolution=(8, 8), render_pass="/pass"))
    sights = {shape.path: description.surfaces[shape.surface].camera for shape in description.shapes}
    assert [str(sights[path].value) for path in (kept, lost)] == ["seen", "matte"]


def test_instances_without_members_stay_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[str] = []

    def noted(instance: Usd.Prim) -> None:
        ended.append(instance.GetName())
        end_instance(instance)

    monkeypatch.setattr(edits, "end_instance", noted)
    assert total(rendered("rel collection:renderVisibility:excludes = </one>")[0]) == WHOLE - 2
    assert ended == []
    assert total(rendered("rel collection:renderVisibility:excludes = [</one>, </two/leaf>]")[0]) == WHOLE - 3
    assert ended == ["two"]


ELSEWHERE = """class "kinds"
{
    def Xform "kind"
    {
        def Cube "a"
        {
        }
        def Cube "b"
        {
        }
    }
    def PointInstancer "few"
    {
        point3f[] positions = [(1, 0, 0)]
        int[] protoIndices = [0]
        rel prototypes = </kinds/kind>
    }
}
"""
CROWD = """def PointInstancer "NAME"
{
    point3f[] positions = [(0, 0, 0)]
    int[] protoIndices = [0]
    rel prototypes = </kinds/DRAWS>
}
"""
SEEN, HIDDEN, MATTE = "seen", "hidden", "matte"


def of_crowds(body: str, crowds: str) -> tuple[dict[str, str], list[str]]:
    """What the camera sees of the shapes that are drawn, and what is reported of the pass."""
    stage = stage_of(f'{ELSEWHERE}{crowds}def RenderPass "pass"\n{{\n{body}\n}}\n')
    description, found = translate(stage, RenderSettings(resolution=(8, 8), render_pass="/pass"))
    seen = {s.path.removeprefix("/kinds/kind/"): str(description.surfaces[s.surface].camera.value) for s in description.shapes}
    return seen, [d.attribute for d in found if d.prim_path == "/pass"]


ONLY = "rel collection:{0}:includes = </crowd>\nuniform bool collection:{0}:includeRoot = 0"


@pytest.mark.parametrize("draws", ["kind", "few"])
@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("rel collection:matte:includes = </crowd>", {"a": MATTE, "b": MATTE}),
        ("rel collection:matte:includes = </crowd>\nrel collection:matte:excludes = </kinds/kind/b>", {"a": MATTE, "b": SEEN}),
        ("rel collection:matte:includes = </kinds/kind/b>", {"a": SEEN, "b": MATTE}),
        ('pathExpression collection:matte:membershipExpression = "/crowd"', {"a": MATTE, "b": MATTE}),
        ("rel collection:cameraVisibility:excludes = </crowd>", {"a": HIDDEN, "b": HIDDEN}),
        (ONLY.format("cameraVisibility"), {"a": SEEN, "b": SEEN}),
        (ONLY.format("renderVisibility"), {"a": SEEN, "b": SEEN}),
        ("rel collection:renderVisibility:excludes = [</crowd>, </other>]", {}),
        ("rel collection:renderVisibility:excludes = </kinds/kind/b>", {"a": SEEN}),
    ],
)
def test_what_an_instancer_draws_elsewhere_is_as_the_instancer(body: str, expected: dict[str, str], draws: str) -> None:
    """Unless the collection names it, or what is above it."""
    assert of_crowds(body, CROWD.replace("NAME", "crowd").replace("DRAWS", draws)) == (expected, [])


@pytest.mark.parametrize("name", ["matte", "cameraVisibility"])
def test_instancers_of_one_prototype_that_a_pass_tells_apart_are_reported(name: str) -> None:
    both = "".join(CROWD.replace("NAME", each).replace("DRAWS", "kind") for each in ("crowd", "other"))
    one = f"rel collection:{name}:{'includes' if name == 'matte' else 'excludes'}"
    assert of_crowds(f"{one} = </crowd>", both) == ({"a": SEEN, "b": SEEN}, [f"collection:{name}"])
    alike = MATTE if name == "matte" else HIDDEN
    assert of_crowds(f"{one} = [</crowd>, </other>]", both) == ({"a": alike, "b": alike}, [])
    assert of_crowds("rel collection:renderVisibility:excludes = </crowd>", both) == ({"a": SEEN, "b": SEEN}, [])
