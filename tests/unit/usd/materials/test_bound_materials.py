"""What is bound is asked of USD once for prims that cannot but be bound alike: each has what USD says of it alone."""

from __future__ import annotations

from typing import Any

import pytest
from pxr import Usd, UsdShade

from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.materials import bound_materials
from primray.usd.scene import inheritance

from ..scene.test_bindings import MATERIALS
from ..usd_text import stage_of

STRONGER = ' (bindMaterialAs = "strongerThanDescendants")'


def sphere(name: str, binding: str = "", api: bool = True) -> str:
    applied = '(prepend apiSchemas = ["MaterialBindingAPI"])' if api else ""
    return f'def Sphere "{name}" {applied} {{\n{binding}\n}}\n'


def bind(material: str, purpose: str = "", strength: str = "") -> str:
    return f"rel material:binding{purpose} = </{material}>{strength}\n"


def group(name: str, binding: str, inside: str, api: bool = True) -> str:
    applied = '(prepend apiSchemas = ["MaterialBindingAPI"])' if api else ""
    return f'def Xform "{name}" {applied} {{\n{binding}\n{inside}\n}}\n'


LEAVES = (
    sphere("bare")
    + sphere("red", bind("red"))
    + sphere("also_red", bind("red"))
    + sphere("no_schema", bind("red"), api=False)
    + sphere("full", bind("green", ":full"))
    + sphere("both", bind("green", ":full") + bind("blue"))
    + sphere("preview", bind("green", ":preview"))
    + sphere("nowhere", "rel material:binding = </nothing>")
    + sphere("emptied", "rel material:binding = None")
    + sphere("two", "rel material:binding = [</red>, </green>]")
    + group("deeper", "", sphere("bare") + group("bound", bind("blue"), sphere("bare") + sphere("green", bind("green"))))
)
STAGE = MATERIALS + "".join(
    group(f"g{i}", binding, LEAVES, api)
    for i, (binding, api) in enumerate(
        (
            ("", True),
            (bind("blue"), True),
            (bind("blue"), False),
            (bind("blue", strength=STRONGER), True),
            (bind("blue", ":full", STRONGER) + bind("red"), True),
            (bind("red", ":preview", STRONGER), True),
        )
    )
)


def by_itself(prim: Usd.Prim) -> str:
    """The first of full and the general purpose that gives one: what translation asks for by default."""
    api = UsdShade.MaterialBindingAPI(prim)
    found, _ = api.ComputeBoundMaterial(UsdShade.Tokens.full)
    return str(found.GetPrim().GetPath()) if found else ""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    counts: list[int] = []

    def counted(prims: list[Usd.Prim], purposes: tuple[str, ...]) -> Any:
        counts.append(len(prims))
        return original(prims, purposes)

    original = inheritance.bind_materials
    monkeypatch.setattr(bound_materials, "bind_materials", counted)
    return counts


def test_each_shape_is_bound_as_if_asked_alone(asked: list[int]) -> None:
    stage = stage_of(STAGE)
    description, _ = translate(stage, RenderSettings(default_light=False))
    found = {shape.path: description.surfaces[int(shape.surface)].path for shape in description.shapes}  # type: ignore[arg-type]
    expected = {str(p.GetPath()): by_itself(p) for p in stage.Traverse() if p.GetTypeName() == "Sphere"}
    assert found == expected
    assert len(set(expected.values())) == 4
    assert asked[0] < len(expected)


def test_many_that_are_bound_alike_are_one_question(asked: list[int]) -> None:
    own = "".join(sphere(f"own_{i}", bind("red")) for i in range(20))
    below = group("below", bind("green"), "".join(sphere(f"bare_{i}") for i in range(20)))
    translate(stage_of(MATERIALS + own + below + "".join(sphere(f"free_{i}") for i in range(20))), RenderSettings())
    assert asked == [2]


def test_each_that_lacks_the_schema_is_noted() -> None:
    stage = stage_of(MATERIALS + "".join(sphere(f"s{i}", bind("red"), api=False) for i in range(3)))
    _, diagnostics = translate(stage, RenderSettings())
    assert {d.prim_path for d in diagnostics if d.code == "binding-api"} == {"/s0", "/s1", "/s2"}


def test_a_collection_makes_them_all_ask(asked: list[int]) -> None:
    collection = (
        'def Xform "world" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:some"])\n{\n'
        "    rel collection:some:includes = </world/b>\n"
        "    rel material:binding:collection:mine = [</world.collection:some>, </red>]\n"
        + "".join(sphere(name) for name in "abc")
        + "}\n"
    )
    description, _ = translate(stage_of(MATERIALS + collection), RenderSettings())
    found = {shape.path: description.surfaces[int(shape.surface)].path for shape in description.shapes}  # type: ignore[arg-type]
    assert found == {"/world/a": "", "/world/b": "/red", "/world/c": ""}
    assert asked == [3]


def test_a_collection_above_a_point_instancers_prototypes() -> None:
    """Nobody walks over an `over`, which keeps prototypes from being drawn by themselves."""
    text = """
over "protos" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:some"])
{
    rel collection:some:includes = </protos/p/b>
    rel material:binding:collection:mine = [</protos.collection:some>, </red>]
    def Xform "p"
    {
        def Sphere "a" {}
        def Sphere "b" {}
    }
}
def PointInstancer "field"
{
    rel prototypes = </protos/p>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (3, 0, 0)]
}
"""
    description, _ = translate(stage_of(MATERIALS + text.replace("{}", "{\n}")), RenderSettings())
    found = {shape.path: description.surfaces[int(shape.surface)].path for shape in description.shapes}  # type: ignore[arg-type]
    assert found == {"/protos/p/a": "", "/protos/p/b": "/red"}


def test_instances_bound_alike_are_one_question(asked: list[int]) -> None:
    asset = 'class "asset"\n{\n' + sphere("bare") + sphere("own", bind("blue")) + "}\n"
    meta = 'prepend apiSchemas = ["MaterialBindingAPI"]\n instanceable = true\n references = </asset>'
    some = "".join(f'def Xform "{m}_{i}" (\n{meta}\n)\n{{\n{bind(m)}\n}}\n' for m in ("red", "green") for i in range(5))
    stage = stage_of(MATERIALS + asset + some + group("g", bind("red"), some.replace("_", "_in_g_")))
    description, _ = translate(stage, RenderSettings())
    of = [
        sorted(description.surfaces[int(description.shapes[p.shape].surface)].path for p in prototype.shapes)  # type: ignore[arg-type]
        for prototype in description.prototypes
    ]
    assert sorted(of) == [["/blue", "/green"], ["/blue", "/red"]]
    assert sorted(len(placement) for placement in description.placements) == [10, 10]
    assert asked[0] == 4


@pytest.mark.parametrize("purpose", ["", ":full"])
def test_instances_whose_bindings_differ_in_strength_are_apart(purpose: str) -> None:
    asset = 'class "asset"\n{\n' + sphere("own", bind("blue", purpose)) + "}\n"
    meta = 'prepend apiSchemas = ["MaterialBindingAPI"]\n instanceable = true\n references = </asset>'
    for first, second in (("", STRONGER), (STRONGER, "")):
        instances = (
            f'def Xform "{name}" (\n{meta}\n)\n{{\n{bind("red", purpose, s)}\n}}\n'
            for name, s in zip("ab", (first, second), strict=True)
        )
        description, _ = translate(stage_of(MATERIALS + asset + "".join(instances)), RenderSettings())
        found = [description.surfaces[int(description.shapes[one.shape].surface)].path for one in description.static]  # type: ignore[arg-type]
        assert found == ["/red" if strength else "/blue" for strength in (first, second)]


def test_an_expression_is_of_each_prim_that_binds_it() -> None:
    """Two groups bind one collection, and each looks into the instances that are below it."""
    asset = 'class "asset"\n{\n' + sphere("a") + sphere("b") + "}\n"
    bound = "rel material:binding:collection:mine = [</some.collection:some>, </red>]"
    instance = 'def Xform "i{0}" (\ninstanceable = true\n references = </asset>\n)\n{{\n}}\n'
    groups = "".join(group(f"g{i}", bound, instance.format(i)) for i in range(2))
    collection = 'def Scope "some" (prepend apiSchemas = ["CollectionAPI:some"])\n{\n'
    collection += '    uniform pathExpression collection:some:membershipExpression = "//i1/b"\n}\n'
    description, _ = translate(stage_of(MATERIALS + asset + collection + groups), RenderSettings())
    shapes = [description.shapes[one.shape] for one in description.static]
    found = sorted((shape.path[-1], description.surfaces[int(shape.surface)].path) for shape in shapes)  # type: ignore[arg-type]
    assert found == [("a", ""), ("a", ""), ("b", ""), ("b", "/red")]
