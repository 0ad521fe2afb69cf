"""Whom lights reach: collections with includes, excludes, rules and expressions; prims, native instances, point instancers."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from primray.description import SceneDescription
from primray.usd.lights.light_links import MAX_OWN

from ..usd_text import translate_text

SPHERES = """
def Xform "set" (
    prepend apiSchemas = ["CollectionAPI:own"]
)
{
    rel collection:own:includes = </set/group>
    def Sphere "a"
    {
    }
    def Xform "group"
    {
        def Sphere "b"
        {
        }
    }
}
def Sphere "c"
{
}
"""


def light(body: str, name: str = "light", collection: str = "lightLink") -> str:
    text = body.replace("COL", f"collection:{collection}")
    return f'def SphereLight "{name}"\n{{\n{text}\n}}\n'


def held(d: SceneDescription, number: int) -> list[str]:
    """Paths of the shapes in a collection, once for each shape."""
    return [s.path for s in d.shapes if d.linked.members.size == 0 or d.linked.members[s.link_row, number]]


def reached(stage: str, body: str, collection: str = "lightLink") -> list[str]:
    d, found = translate_text(stage + light(body, collection=collection))
    assert {code for code, _ in found} <= {"camera-automatic", "link-empty", "instances-coincident"}
    (only,) = d.lights
    number, other = (only.light_link, only.shadow_link)[:: 1 if collection == "lightLink" else -1]
    assert other == 0
    return held(d, number)


A, B, C = "/set/a", "/set/group/b", "/c"
NONE_BUT = "uniform bool COL:includeRoot = false\n"
EXPRESSION = NONE_BUT + 'uniform pathExpression COL:membershipExpression = "{}"'


@pytest.mark.conforms("LightAPI.collection:lightLink:includeRoot", "LightAPI.collection:shadowLink:includeRoot")
@pytest.mark.conforms("LightAPI.collection:lightLink", "LightAPI.collection:shadowLink")
@pytest.mark.parametrize("collection", ["lightLink", "shadowLink"])
@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("", [A, B, C]),
        ("uniform bool COL:includeRoot = true", [A, B, C]),
        (NONE_BUT, []),
        (NONE_BUT + "rel COL:includes = </set>", [A, B]),
        (NONE_BUT + "rel COL:includes = [</set>, </c>]\nrel COL:excludes = </set/group>", [A, C]),
        ("rel COL:excludes = </set/group>", [A, C]),
        ("rel COL:excludes = [</set>]\nrel COL:includes = </set/group/b>", [B, C]),
        (NONE_BUT + 'uniform token COL:expansionRule = "explicitOnly"\nrel COL:includes = [</set>, </set/a>]', [A]),
        (NONE_BUT + 'uniform token COL:expansionRule = "expandPrimsAndProperties"\nrel COL:includes = [</set>]', [A, B]),
        (EXPRESSION.format("//b"), [B]),
        (EXPRESSION.format("/set// - /set/group//"), [A]),
        (EXPRESSION.format("//"), [A, B, C]),
        ('uniform token COL:mode = "expression"\nuniform pathExpression COL:membershipExpression = "~/c"', [A, B]),
        # includeRoot is true: the expression is ignored, as the mode is automatic.
        ('uniform pathExpression COL:membershipExpression = "/c"', [A, B, C]),
        (NONE_BUT + "rel COL:includes = </set.collection:own>", [B]),
    ],
)
def test_membership(body: str, expected: list[str], collection: str) -> None:
    assert sorted(reached(SPHERES, body, collection)) == sorted(expected)


def test_no_collection_no_table() -> None:
    d, _ = translate_text(SPHERES + light("") + light("uniform bool COL:includeRoot = true", "more"))
    assert d.linked.collections == ()
    assert d.linked.members.size == 0
    assert {s.link_row for s in d.shapes} == {0}


def test_equal_collections_have_one_number() -> None:
    text = NONE_BUT + "rel COL:includes = </set>"
    d, _ = translate_text(
        SPHERES + light(text, "one") + light(text, "two", "shadowLink") + light(NONE_BUT + "rel COL:includes = </c>", "three")
    )
    assert [(x.light_link, x.shadow_link) for x in d.lights] == [(1, 0), (0, 1), (2, 0)]
    assert d.linked.collections == ("/one.collection:lightLink", "/three.collection:lightLink")


def test_a_collection_that_holds_nothing_is_told() -> None:
    d, found = translate_text(SPHERES + light(NONE_BUT + "rel COL:includes = </nowhere>"))
    assert ("link-empty", "/light") in found
    assert held(d, d.lights[0].light_link) == []


INSTANCES = """
class Xform "asset"
{
    def Sphere "ball"
    {
    }
    def Xform "inner"
    {
        def Sphere "core"
        {
        }
    }
}
def Xform "w"
{
    def Xform "i1" (
        instanceable = true
        inherits = </asset>
    )
    {
        double3 xformOp:translate = (1, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "i2" (
        instanceable = true
        inherits = </asset>
    )
    {
        double3 xformOp:translate = (2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "i3" (
        instanceable = true
        inherits = </asset>
    )
    {
        double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


def placed(d: SceneDescription, number: int) -> list[tuple[str, float]]:
    """Name and x of every instance of every shape that the collection holds."""
    found: list[tuple[str, float]] = []

    def add(shapes: Iterable[int], x: float) -> None:
        for k in shapes:
            s = d.shapes[k]
            if d.linked.members.size == 0 or d.linked.members[s.link_row, number]:
                found.append((s.path.rpartition("/")[2], round(x, 3)))

    for p in d.static:
        add([p.shape], p.matrix[0, 3])
    for placement in d.placements:
        for rows in placement.chunks():
            for m in rows:
                add([s.shape for s in d.prototypes[placement.prototype].shapes], m[0, 3])
    return sorted(found)


def both(*x: float) -> list[tuple[str, float]]:
    return sorted([("ball", v) for v in x] + [("core", v) for v in x])


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (NONE_BUT + "rel COL:includes = </w/i2>", both(2)),
        ("rel COL:excludes = </w/i2>", both(1, 3)),
        (NONE_BUT + "rel COL:includes = </w>", both(1, 2, 3)),
        (NONE_BUT + "rel COL:includes = </w/i2/ball>", [("ball", 2)]),
        ("rel COL:excludes = [</w/i2/inner>, </w/i1>]", [("ball", 2), ("ball", 3), ("core", 3)]),
        (EXPRESSION.format("//core"), [("core", 1), ("core", 2), ("core", 3)]),
        (EXPRESSION.format("/w/i1//core /w/i3//"), [("ball", 3), ("core", 1), ("core", 3)]),
        (NONE_BUT + "rel COL:includes = </asset>", []),
    ],
)
def test_native_instances(body: str, expected: list[tuple[str, float]]) -> None:
    d, _ = translate_text(INSTANCES + light(body))
    assert placed(d, d.lights[0].light_link) == expected
    assert placed(d, 0) == both(1, 2, 3)


def test_instances_that_are_linked_alike_stay_one_prototype() -> None:
    d, _ = translate_text(INSTANCES + light(EXPRESSION.format("//core")) + light(NONE_BUT + "rel COL:includes = </w>", "more"))
    assert len(d.prototypes) == 1
    d, _ = translate_text(INSTANCES + light("rel COL:excludes = </w/i2>"))
    assert [len(p) for p in d.placements] == [2]
    assert len(d.static) == 2


NESTED = """
class Xform "outer"
{
    def Xform "left" (
        instanceable = true
        inherits = </asset>
    )
    {
    }
    def Xform "right" (
        instanceable = true
        inherits = </asset>
    )
    {
        double3 xformOp:translate = (0.5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


def test_instances_in_instances() -> None:
    nested = INSTANCES.replace("inherits = </asset>", "inherits = </outer>") + NESTED
    d, _ = translate_text(nested + light(NONE_BUT + "rel COL:includes = [</w/i2/right/ball>, </w/i3/left>]"))
    assert placed(d, 1) == [("ball", 2.5), ("ball", 3), ("core", 3)]
    assert len(placed(d, 0)) == 12


LAMP = """
class Xform "lamp"
{
    def Sphere "shade"
    {
    }
    def Sphere "stand"
    {
    }
    def SphereLight "bulb"
    {
        rel collection:shadowLink:excludes = </lamp/shade>
    }
}
"""


def lamp(x: float) -> str:
    return f"""
def "lamp{x:g}" (
    instanceable = true
    inherits = </lamp>
)
{{
    double3 xformOp:translate = ({x}, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


def test_a_light_in_instances_is_linked_to_its_own() -> None:
    d, _ = translate_text(LAMP + lamp(1) + lamp(2) + lamp(3))
    assert sorted(x.shadow_link for x in d.lights) == [1, 2, 3]
    for x in d.lights:
        at = x.world_from_light[0, 3]
        expected = sorted([(n, k) for k in (1, 2, 3) for n in ("shade", "stand") if (n, k) != ("shade", at)])
        assert placed(d, x.shadow_link) == expected


def test_a_light_in_very_many_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.usd.lights.light_links.MAX_OWN", 2)
    d, found = translate_text(LAMP + lamp(1) + lamp(2) + lamp(3) + lamp(4))
    assert "link-limited" in {code for code, _ in found}
    assert sorted(x.shadow_link for x in d.lights) == [0, 0, 1, 2]
    assert MAX_OWN == 1024


POINTS = """
def PointInstancer "{name}"
{{
    int[] protoIndices = [0, 1]
    point3f[] positions = [({x}, 0, 0), ({x}.5, 0, 0)]
    rel prototypes = [{prototypes}]
    def Xform "protos"
    {{
        def Sphere "p"
        {{
        }}
        def Sphere "q"
        {{
        }}
    }}
}}
"""
BELOW = POINTS.format(name="one", x=1, prototypes="</one/protos/p>, </one/protos/q>")
APART = 'over "lib"\n{\n def Sphere "p"\n {\n }\n def Sphere "q"\n {\n }\n}\n'
SHARED = APART + "".join(POINTS.format(name=n, x=x, prototypes="</lib/p>, </lib/q>") for n, x in (("one", 1), ("two", 2)))


@pytest.mark.parametrize(
    ("stage", "body", "expected"),
    [
        (BELOW, NONE_BUT + "rel COL:includes = </one>", [("p", 1), ("q", 1.5)]),
        (BELOW, "rel COL:excludes = </one/protos/q>", [("p", 1)]),
        (SHARED, NONE_BUT + "rel COL:includes = </two>", [("p", 2), ("q", 2.5)]),
        (SHARED, "rel COL:excludes = </two>", [("p", 1), ("q", 1.5)]),
        (SHARED, NONE_BUT + "rel COL:includes = </lib/p>", [("p", 1), ("p", 2)]),
        (SHARED, "rel COL:excludes = </lib/p>", [("q", 1.5), ("q", 2.5)]),
        (SHARED, NONE_BUT + "rel COL:includes = </two>\nrel COL:excludes = </lib/q>", [("p", 2)]),
        (SHARED, EXPRESSION.format("/two"), [("p", 2), ("q", 2.5)]),
        (SHARED, EXPRESSION.format("//q"), [("q", 1.5), ("q", 2.5)]),
    ],
)
def test_point_instancers(stage: str, body: str, expected: list[tuple[str, float]]) -> None:
    d, _ = translate_text(stage + light(body))
    assert placed(d, d.lights[0].light_link) == expected


def test_point_instancers_of_native_instances() -> None:
    lib = APART.replace('def Sphere "p"\n {', 'def Xform "p" (\n instanceable = true\n inherits = </asset>\n )\n {')
    stage = INSTANCES + lib + POINTS.format(name="two", x=7, prototypes="</lib/p>, </lib/q>")
    d, _ = translate_text(stage + light(NONE_BUT + "rel COL:includes = [</two>, </w/i1>]"))
    assert placed(d, 1) == sorted([*both(1, 7), ("q", 7.5)])
    d, _ = translate_text(stage + light("rel COL:excludes = </lib/p/ball>"))
    assert ("ball", 7) not in placed(d, 1)
    assert ("core", 7) in placed(d, 1)


def test_a_broken_collection_is_told() -> None:
    _, found = translate_text(SPHERES + light("custom int COL:includes = 3\nuniform bool COL:includeRoot = false"))
    assert {code for code, path in found if path == "/light"} & {"wrong-type", "link-empty"}


@pytest.mark.conforms("LightListAPI.lightList", "LightListAPI.lightList:cacheBehavior")
@pytest.mark.conforms("ListAPI.lightList", "ListAPI.lightList:cacheBehavior")
@pytest.mark.parametrize("schema", ["LightListAPI", "ListAPI"])
@pytest.mark.parametrize("behavior", ["consumeAndHalt", "consumeAndContinue", "ignore", "nonsense"])
def test_a_cached_list_of_lights_changes_nothing(behavior: str, schema: str) -> None:
    """The list is for finding lights without loading payloads; what is rendered is loaded, and all its lights are found."""
    text = f"""
def Xform "model" (
    prepend apiSchemas = ["{schema}"]
)
{{
    rel lightList = [</model/listed>, </gone>]
    token lightList:cacheBehavior = "{behavior}"
    def SphereLight "listed"
    {{
    }}
    def SphereLight "unlisted"
    {{
    }}
}}
"""
    d, found = translate_text(text)
    assert [x.path for x in d.lights] == ["/model/listed", "/model/unlisted"]
    assert {code for code, _ in found} <= {"camera-automatic"}


def test_a_prototype_inside_an_instance() -> None:
    """What a point instancer places is asked for by the proxy that it names."""
    stage = INSTANCES + POINTS.format(name="two", x=7, prototypes="</w/i1/ball>, </w/i2/inner>")
    d, _ = translate_text(stage + light("rel COL:excludes = </w/i1/ball>"))
    assert placed(d, 1) == sorted([*both(2, 3), ("core", 1), ("core", 7.5)])
    d, _ = translate_text(stage + light(NONE_BUT + "rel COL:includes = [</two>, </w/i3>]"))
    assert placed(d, 1) == sorted([*both(3), ("ball", 7), ("core", 7.5)])


def test_instances_that_are_shapes_themselves() -> None:
    """Each is in the collection of the light below it, and in no other's; nothing else tells the two instances apart."""
    orb = 'class Sphere "orb"\n{\n    def SphereLight "bulb"\n    {\n'
    orb += '        uniform token collection:lightLink:expansionRule = "explicitOnly"\n'
    orb += "        rel collection:lightLink:includes = </orb>\n    }\n}\n"
    d, _ = translate_text(orb + lamp(1).replace("</lamp>", "</orb>") + lamp(2).replace("</lamp>", "</orb>"))
    assert len(d.lights) == 2
    for x in d.lights:
        assert [at for _, at in placed(d, x.light_link)] == [x.world_from_light[0, 3]]
