"""What prototypes of point instancers inherit, below their instancer and elsewhere."""

from __future__ import annotations

import pytest

from primray.settings import RenderSettings

from ..scene.test_walk import bound, materials
from ..usd_text import translate_text

BALL = 'def Sphere "ball"\n{\n}\n'


def instancer(root: str, inside: str = "", lines: str = "", meta: str = "", name: str = "field") -> str:
    applied = f"({meta})" if meta else ""
    return f"""def PointInstancer "{name}" {applied}
{{
    rel prototypes = <{root}>
    int[] protoIndices = [0]
    point3f[] positions = [(0, 0, 9)]
    {lines}
    {inside}
}}
"""


def shown(text: str) -> list[tuple[str, tuple[float, ...] | str]]:
    """The material or the colour of each shape, by its path."""
    description, _ = translate_text(text, RenderSettings(default_light=False))
    surfaces = [(shape.path, description.surfaces[int(shape.surface)]) for shape in description.shapes]  # type: ignore[arg-type]
    return [(path, surface.path or surface.diffuse_color) for path, surface in surfaces]


RED, GREEN = "color3f[] primvars:displayColor = [(1, 0, 0)]", "color3f[] primvars:displayColor = [(0, 1, 0)]"
VERTEX = 'color3f[] primvars:displayColor = [(1, 1, 0), (1, 0, 1)] (interpolation = "vertex")'
LIB = 'over Scope "lib"\n{{\n{0}\n{1}}}\n'


@pytest.mark.parametrize(
    ("on_lib", "on_instancer", "expected"),
    [
        (GREEN, "", (0, 1, 0)),
        ("", RED, (1, 0, 0)),
        (GREEN, RED, (0, 1, 0)),
        (VERTEX, RED, (1, 0, 0)),
        ("color3f[] primvars:displayColor = None", RED, (1, 0, 0)),
        (VERTEX, "", (0.18, 0.18, 0.18)),
    ],
)
def test_a_prototype_elsewhere_has_the_primvars_of_its_namespace(
    on_lib: str, on_instancer: str, expected: tuple[float, ...]
) -> None:
    assert shown(LIB.format(on_lib, BALL) + instancer("/lib/ball", lines=on_instancer)) == [("/lib/ball", expected)]


def test_a_primvar_between_hides_the_values_of_instances() -> None:
    varying = 'color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "vertex")'
    inside = f'def Scope "s"\n{{\n{VERTEX}\n{BALL}}}\n'
    assert shown(instancer("/field/s/ball", inside, varying)) == [("/field/s/ball", (0.18, 0.18, 0.18))]


PURPOSE = 'uniform token purpose = "guide"'


@pytest.mark.parametrize(("on_lib", "on_instancer", "is_drawn"), [(PURPOSE, "", False), ("", PURPOSE, False), ("", "", True)])
def test_its_purpose_is_that_of_its_namespace_else_that_of_the_instancer(
    on_lib: str, on_instancer: str, is_drawn: bool
) -> None:
    found = shown(LIB.format(on_lib, BALL) + instancer("/lib/ball", lines=on_instancer))
    assert bool(found) == is_drawn


def test_visibility_above_it_hides_nothing() -> None:
    for visibility in ('token visibility = "invisible"', 'uniform token renderVisibility = "invisible"'):
        inside = f'def Scope "s" (prepend apiSchemas = ["VisibilityAPI"])\n{{\n{visibility}\nuniform token purpose = "render"\n'
        assert len(shown(instancer("/field/s/ball", inside + BALL + "}\n"))) == 1


def test_a_native_instances_binding_stays_with_what_is_in_the_instance() -> None:
    """An inherit, unlike a reference, leads relationships out of the class; what they lead to is bound by its own namespace."""
    model = f'class Xform "model"\n{{\n{instancer("/lib/ball")}\n{BALL}}}\n'
    meta = "    instanceable = true\n    inherits = </model>"
    instance = f'def Xform "i" {bound("red", meta)}}}\n'
    found = shown(materials("red") + LIB.format("", BALL) + model + instance)
    assert sorted(found) == [("/i/ball", "/red"), ("/lib/ball", (0.18, 0.18, 0.18))]


def test_prototypes_inside_native_instances_are_bound_as_their_proxies_are() -> None:
    """Two instancers draw the same prim of two instances, whose bindings differ in strength."""
    part = f'def Xform "part" {bound("own")}def Sphere "ball"\n{{\n}}\n}}\n'
    model = f'over "model"\n{{\n{part}}}\n'
    meta = "    instanceable = true\n    references = </model>"
    instances = f'def Xform "weak" {bound("red", meta)}}}\ndef Xform "strong" {bound("red", meta, stronger=True)}}}\n'
    drawn = "".join(instancer(f"/over/{name}/part", name=name) for name in ("weak", "strong"))
    text = materials("own", "red") + model + 'over "over"\n{\n' + instances + "}\n" + drawn
    assert {material for _, material in shown(text)} == {"/own", "/red"}


def test_collections_above_prototypes_look_into_instances_in_them() -> None:
    """Nobody walks over the `over` that binds the collection."""
    model = f'class Xform "model"\n{{\n{BALL}def Sphere "other"\n{{\n}}\n}}\n'
    root = 'def Xform "root"\n{\n def Xform "i" (instanceable = true\n references = </model>)\n {\n }\n}\n'
    above = """over "lib" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:c"])
{
    rel collection:c:includes = </lib/root/i/other>
    rel material:binding:collection:c = [</lib.collection:c>, </red>]
"""
    found = dict(shown(materials("red") + model + above + root + "}\n" + instancer("/lib/root")))
    assert sorted(map(str, found.values())) == ["(0.18, 0.18, 0.18)", "/red"]


def test_the_up_axis_of_cards_is_hidden_inside_instances_too() -> None:
    box = "float3[] extentsHint = [(-1, -1, -1), (1, 1, 1)]"
    card = f'def Xform "card" (kind = "component")\n{{\nuniform token model:drawMode = "cards"\n{box}\n{BALL}}}\n'
    model = f'class Xform "model" (kind = "group")\n{{\n{card}}}\n'
    instance = 'def Xform "i" (kind = "group"\n instanceable = true\n references = </model>)\n{\n LINE\n}\n'
    for line, cards in (("", 6), ('uniform token model:cardVisibility = "simple"', 4)):
        description, _ = translate_text(model + instance.replace("LINE", line))
        assert [len(shape.triangles) // 2 for shape in description.shapes] == [cards]  # type: ignore[union-attr]


@pytest.mark.parametrize("nested", [False, True])
def test_a_prototype_beside_its_instancer_has_the_primvars_of_its_native_instance(nested: bool) -> None:
    """Also where the instancer is itself in a prototype that hands down another colour."""
    beside = f'def Scope "lib"\n{{\n{BALL}}}\n'
    field = instancer(
        "/model/lib/ball" if not nested else "/model/outer/field/ball", BALL if nested else "", GREEN, name="field"
    )
    if nested:
        field = instancer("/model/outer/field", instancer("/model/lib/ball"), GREEN, name="outer")
    instance = f'def Xform "i" (instanceable = true\n references = </model>)\n{{\n{RED}\n}}\n'
    found = shown(f'class "model"\n{{\n{beside}{field}}}\n{instance}')
    assert found == [("/i/lib/ball", (1, 0, 0))] * len(found)
    assert found
