"""Looks of documents: what they do to a model beside binding materials by paths, and what they report."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from pxr import Usd, UsdShade

from primray.description import CameraVisibility, SceneDescription
from primray.diagnostic_codes import Severity
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import open_stage, translate

COLORS = {"Red": "1, 0, 0", "Green": "0, 1, 0", "Blue": "0, 0, 1"}
MATERIALS = "".join(
    f"""<surface_unlit name="S{name}" type="surfaceshader"><input name="emission_color" type="color3" value="{color}"/>
    </surface_unlit><surfacematerial name="{name}" type="material">
      <input name="surfaceshader" type="surfaceshader" nodename="S{name}"/></surfacematerial>"""
    for name, color in COLORS.items()
)
RED = '<materialassign name="all" material="Red" geom="/"/>'
MODEL = """#usda 1.0
def Xform "Model" (
    references = @looks.mtlx@</ModelRoot>
    {selection}
)
{{
    def Sphere "a" {{}}
    def Xform "b"
    {{
        def Sphere "c" {{}}
        def Sphere "d" {{}}
    }}
    def SphereLight "lamp" {{}}
}}
"""
INSTANCE = 'def Xform "Model" (\n instanceable = true\n references = </Class>\n) {}\n'
CHOSEN = 'variants = {\nstring LookVariant = "L"\n}'


def staged(folder: Path, looks: str, selection: str = CHOSEN, *, instance: bool = False) -> Usd.Stage:
    (folder / "looks.mtlx").write_text(f'<materialx version="1.39">{MATERIALS}{looks}</materialx>')
    text = MODEL.format(selection=selection)
    if instance:
        text = text.replace('def Xform "Model"', 'class Xform "Class"') + INSTANCE
    (folder / "stage.usda").write_text(text)
    return open_stage(folder / "stage.usda", Diagnostics())


def look(*inside: str, name: str = "L", attributes: str = "") -> str:
    return f'<look name="{name}" {attributes}>{"".join(inside)}</look>'


def translated(stage: Usd.Stage) -> tuple[SceneDescription, list[str]]:
    description, said = translate(stage, RenderSettings())
    return description, [d.message for d in said if d.severity is not Severity.INFO and d.code != "unlit"]


def bound(stage: Usd.Stage, path: str) -> str:
    """Return the name of the document's material that a prim is bound to."""
    material, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)).ComputeBoundMaterial()
    specs = material.GetPrim().GetPrimStack() if material else []
    return next((spec.name for spec in specs if str(spec.path.GetParentPath()) == "/MaterialX/Materials"), "")


def shapes(description: SceneDescription) -> set[str]:
    return {shape.path for shape in description.shapes}


def visibility(geom: str, visible: bool = False, more: str = "") -> str:
    return f'<visibility name="v{geom}{visible}" geom="{geom}" visible="{str(visible).lower()}" {more}/>'


VISIBLE = {  # visibility elements, and which shapes are left
    "one": ([visibility("/a")], "cd"),
    "all": ([visibility("/")], ""),
    "all but one": ([visibility("/"), visibility("/b/c", True)], "c"),
    "a branch but one": ([visibility("/b"), visibility("/b/d", True)], "ad"),
    "the last of a place": ([visibility("/a"), visibility("/a", True)], "acd"),
    "wildcards": ([visibility("/b/?")], "a"),
    "leaves": ([visibility("//*")], ""),
    "a prefix": ([visibility("c", more='geomprefix="/b/"')], "ad"),
}


@pytest.mark.parametrize("case", VISIBLE)
@pytest.mark.parametrize("instance", [False, True])
def test_shapes_are_seen_as_the_look_says(case: str, instance: bool, tmp_path: Path) -> None:
    elements, left = VISIBLE[case]
    description, messages = translated(staged(tmp_path, look(RED, *elements), instance=instance))
    assert sorted(path[-1] for path in shapes(description)) == sorted(left)
    assert not any("Look L" in message for message in messages)


def test_what_is_hidden_from_the_camera_is_there_for_others(tmp_path: Path) -> None:
    seen = [visibility("/a", more='vistype="camera"'), visibility("/lamp", more='vistype="camera"')]
    stage = staged(tmp_path, look(RED, *seen))
    description, _ = translated(stage)
    by_path = {shape.path: description.surfaces[shape.surface].camera for shape in description.shapes}
    assert by_path["/Model/a"] is CameraVisibility.HIDDEN
    assert by_path["/Model/b/c"] is CameraVisibility.SEEN
    assert stage.GetAttributeAtPath("/Model/lamp.inputs:visibility:camera").Get() is False


def test_a_light_that_is_not_visible_gives_none(tmp_path: Path) -> None:
    description, _ = translated(staged(tmp_path, look(RED, visibility("/lamp"))))
    assert [light.path for light in description.lights] == []


@pytest.mark.parametrize("assigned", ["propertysetassign", "propertyassign"])
def test_matte_holds_out(assigned: str, tmp_path: Path) -> None:
    properties = '<propertyset name="P"><property name="matte" type="boolean" value="true"/></propertyset>'
    elements = {
        "propertysetassign": '<propertysetassign name="p" propertyset="P" geom="/b"/>',
        "propertyassign": '<propertyassign name="p" property="matte" type="boolean" value="true" geom="/b"/>',
    }
    description, messages = translated(staged(tmp_path, properties + look(RED, elements[assigned])))
    sights = {shape.path[-1]: description.surfaces[shape.surface].camera for shape in description.shapes}
    assert sights == {"a": CameraVisibility.SEEN, "c": CameraVisibility.MATTE, "d": CameraVisibility.MATTE}
    assert not any("Look" in message for message in messages)


def assigned(*pairs: tuple[str, str]) -> Iterable[str]:
    return (f'<materialassign name="m{i}" material="{name}" geom="{geom}"/>' for i, (name, geom) in enumerate(pairs))


def test_a_look_that_inherits_another_comes_after_it(tmp_path: Path) -> None:
    base = look(*assigned(("Red", "/"), ("Green", "/b/c")), name="base")
    stage = staged(tmp_path, look(*assigned(("Blue", "/b")), attributes='inherit="base"') + base)
    assert [bound(stage, f"/Model/{path}") for path in ("a", "b/c", "b/d")] == ["Red", "Green", "Blue"]


def test_a_look_that_inherits_itself_is_reported(tmp_path: Path) -> None:
    _, messages = translated(staged(tmp_path, look(RED, attributes='inherit="L"')))
    assert any("inherits L" in message for message in messages)


def test_the_default_of_a_group_is_chosen_unless_the_stage_chooses(tmp_path: Path) -> None:
    looks = look(RED) + look(*assigned(("Blue", "/")), name="N")
    group = '<lookgroup name="g" looks="L, N" default="N"/><lookgroup name="top" looks="g" default="g"/>'
    assert bound(staged(tmp_path, looks, ""), "/Model/a") == ""
    assert bound(staged(tmp_path, looks + group, ""), "/Model/a") == "Blue"
    assert bound(staged(tmp_path, looks + group), "/Model/a") == "Red"


VARIANTS = """<variantset name="v"><variant name="dim"><input name="emission" type="float" value="0.5"/></variant></variantset>
  <variantset name="w"><variant name="blue"><input name="emission_color" type="color3" value="0, 0, 1" {unit}/>
    <input name="emission" type="float" value="0.25"/></variant></variantset>"""


def variant(of_set: str, name: str) -> str:
    return f'<variantassign name="a_{of_set}" variantset="{of_set}" variant="{name}"/>'


def test_variants_give_values_to_the_materials_of_a_look(tmp_path: Path) -> None:
    own = '<materialassign name="m" material="Red" geom="/a">' + variant("w", "blue") + "</materialassign>"
    other = '<materialassign name="n" material="Red" geom="/b"/>'
    stage = staged(tmp_path, VARIANTS.format(unit="") + look(variant("v", "dim"), own, other))
    description, messages = translated(stage)
    emitted = {shape.path[-1]: description.surfaces[shape.surface].emissive_color for shape in description.shapes}
    assert emitted["a"] == pytest.approx((0, 0, 0.25))  # what is assigned with the material comes last
    assert emitted["c"] == pytest.approx((0.5, 0, 0))
    assert not any("Look" in message for message in messages)


def test_variants_take_the_place_of_what_is_connected(tmp_path: Path) -> None:
    lit = """<constant name="k" type="color3"><input name="value" type="color3" value="1, 1, 1"/></constant>
      <surface_unlit name="T" type="surfaceshader"><input name="emission_color" type="color3" nodename="k"/></surface_unlit>
      <surfacematerial name="Lit" type="material"><input name="surfaceshader" type="surfaceshader" nodename="T"/>
      </surfacematerial>"""
    own = '<materialassign name="m" material="Lit" geom="/">' + variant("w", "blue") + "</materialassign>"
    description, _ = translated(staged(tmp_path, lit + VARIANTS.format(unit="") + look(own)))
    assert description.surfaces[description.shapes[0].surface].emissive_color == pytest.approx((0, 0, 0.25))


REPORTED = {
    "a material that is not there": ('<materialassign name="m" material="Gone" geom="/"/>', "Gone"),
    "a collection that is not there": ('<materialassign name="m" material="Red" collection="gone"/>', "gone"),
    "shadows": (visibility("/a", more='vistype="shadow"'), "shadow"),
    "viewers": (visibility("/a", more='viewergeom="/lamp"'), "/lamp"),
    "an unknown property": ('<propertyassign name="p" property="glow" type="float" value="1" geom="/"/>', "glow"),
    "a variant that is not there": (variant("v", "gone") + RED, "gone"),
    "several materials at once": ('<materialassign name="m" material="Red" geom="/" exclusive="false"/>', "exclusive"),
    "wildcards beside letters that USD's expressions lack": (
        '<materialassign name="m" material="Red" geom="/\u00e9/a*"/>',
        "/\u00e9/a*",
    ),
    "names that no prim has": ('<materialassign name="m" material="Red" geom="/a-b"/>', "/a-b"),
}


@pytest.mark.parametrize("case", REPORTED)
def test_what_a_look_says_without_effect_is_reported_where_it_is_chosen(case: str, tmp_path: Path) -> None:
    element, word = REPORTED[case]
    looks = look(element) + look(RED, name="N")
    _, messages = translated(staged(tmp_path, looks))
    assert [word in message for message in messages if "Look L" in message] == [True]
    _, messages = translated(staged(tmp_path, looks, CHOSEN.replace('"L"', '"N"')))
    assert not any("Look" in message for message in messages)


def test_properties_of_other_renderers_are_theirs(tmp_path: Path) -> None:
    other = '<propertyassign name="p" property="glow" target="other" type="float" value="1" geom="/"/>'
    _, messages = translated(staged(tmp_path, look(RED, other)))
    assert not any("glow" in message for message in messages)


def test_what_an_instance_below_the_model_holds_is_reported(tmp_path: Path) -> None:
    staged(tmp_path, look(RED, visibility("/b/x/c")))
    text = (tmp_path / "stage.usda").read_text()
    inner = 'def "x" (\n instanceable = true\n references = </Part>\n)\n{\n}\n def Sphere "d"'
    part = 'def Xform "Part"\n{\n def Sphere "c" {}\n}\n'
    (tmp_path / "nested.usda").write_text(text.replace('def Sphere "d"', inner) + part)
    description, messages = translated(open_stage(tmp_path / "nested.usda", Diagnostics()))
    assert any("b/x/c" in message for message in messages)
    assert "/Model/a" in shapes(description)
