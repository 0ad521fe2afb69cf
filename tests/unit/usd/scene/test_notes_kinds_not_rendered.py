"""Kinds of prims and schemas that are not rendered: whatever they have authored, a diagnostic says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import OpenImageIO as oiio
import pytest
from pxr import Sdf, Tf, Usd, Vt
from tests.translation.describe import describe

from primray.diagnostics import Diagnostic
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.scene.schemas import IGNORED, UNDERSTOOD

from ..usd_text import stage_of


def authored(prim: Usd.Prim, name: str) -> None:
    """Give the attribute some value of its type."""
    attribute = prim.GetAttribute(name)
    assert attribute.IsDefined(), f"{prim.GetTypeName()} has no {name}"
    value: Any = attribute.GetTypeName().defaultValue
    allowed = attribute.GetMetadata("allowedTokens")
    if isinstance(value, Vt.IntArray):
        value = Vt.IntArray([1, 2])
    attribute.Set(allowed[-1] if allowed else value)


def said(stage: Usd.Stage, settings: RenderSettings | None = None) -> list[Diagnostic]:
    ignored = {"camera-automatic", "default-light"}
    return [d for d in translate(stage, settings or RenderSettings())[1] if d.code not in ignored]


@pytest.mark.parametrize("kind", ["ParticleField", "ParticleField3DGaussianSplat", "GenerativeProcedural"])
def test_other_kinds_that_are_not_rendered(kind: str) -> None:
    assert [d.code for d in said(stage_of(f'def {kind} "x"\n{{\n}}\n'))] == ["unsupported-prim"]
    hidden = stage_of(f'def {kind} "x"\n{{\nuniform token purpose = "guide"\n}}\n')
    assert said(hidden) == []  # not asked for


@pytest.mark.conforms("CoordSysAPI.binding", state="diagnosed")
def test_coordinate_systems() -> None:
    stage = stage_of('def Sphere "s" (prepend apiSchemas = ["CoordSysAPI:paint"])\n{\nrel coordSys:paint:binding = </s>\n}\n')
    assert [(d.code, d.prim_path) for d in said(stage)] == [("api-schema", "/s")]


@pytest.mark.parametrize(
    ("name", "value", "neutral"),
    [
        pytest.param(name, *values, marks=pytest.mark.conforms(f"MotionAPI.{name}", state="diagnosed"), id=name)
        for name, values in {
            "motion:velocityScale": (2.0, 1.0),
        }.items()
    ],
)
def test_motion(name: str, value: Any, neutral: Any) -> None:
    """Told where it differs from its default; the schema's `default` is what changes nothing."""
    stage = stage_of('def Sphere "s" (prepend apiSchemas = ["MotionAPI"])\n{\n}\n')
    attribute = stage.GetPrimAtPath("/s").GetAttribute(name)
    assert attribute.Get() == neutral
    attribute.Set(value)
    assert [(d.code, d.attribute) for d in said(stage)] == [("motion", name)]
    attribute.Set(neutral)
    assert said(stage) == []


def test_every_schema_that_usd_knows_is_read_ignored_aloud_or_without_effect() -> None:
    """A newer USD brings newer ones: somebody has to look at them."""
    registry, base = Usd.SchemaRegistry, Tf.Type.Find(Usd.APISchemaBase)
    known = {str(registry.GetSchemaTypeName(each)) for each in base.GetAllDerivedTypes() if registry.IsAppliedAPISchema(each)}
    assert len(known) > 40
    assert known - UNDERSTOOD - IGNORED.keys() == set()
    assert not UNDERSTOOD & IGNORED.keys()


@pytest.mark.parametrize(
    "schema", ["PhysicsRigidBodyAPI", "PhysicsMassAPI", "SemanticsLabelsAPI:category", "SceneGraphPrimAPI"]
)
def test_schemas_that_mean_nothing_to_pictures_are_not_told(schema: str) -> None:
    assert said(stage_of(f'def Sphere "s" (prepend apiSchemas = ["{schema}"])\n{{\n}}\n')) == []


@pytest.mark.parametrize("schema", ["FancyAPI", "FancyAPI:one", "HydraGenerativeProceduralAPI", "StatementsAPI"])
def test_schemas_that_may_change_it_are(schema: str) -> None:
    found = said(stage_of(f'def Sphere "s" (prepend apiSchemas = ["{schema}"])\n{{\n}}\n'))
    assert [(d.code, d.prim_path) for d in found] == [("api-schema", "/s")]


ROBOT = """def Xform "robot" (prepend apiSchemas = ["PhysicsArticulationRootAPI", "PhysxArticulationAPI", "SemanticsAPI:class"])
{
    def Sphere "a" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "NewtonBodyAPI"])
    {
    }
    def Sphere "b" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysxRigidBodyAPI"])
    {
    }
    def Scope "m" (prepend apiSchemas = ["PhysicsSomethingNewAPI"])
    {
    }
}
"""


def test_schemas_of_other_programs_that_leave_the_picture_are_told_once_a_family() -> None:
    """A robot is not refused for how it is simulated: its severity is info."""
    found = said(stage_of(ROBOT))
    assert {d.code for d in found} == {"foreign-schema"}
    assert not any(d.is_strict for d in found)
    told = {d.prim_path: [e.message for e in found if e.prim_path == d.prim_path] for d in found}
    assert [m.split(". ")[0] for m in told["/robot"]] == [
        "PhysxArticulationAPI and 1 more on 3 prims",
        "SemanticsAPI on this prim",
    ]
    assert [path for path in told if path != "/robot"] == ["/robot/a", "/robot/m"]


@pytest.mark.parametrize("schema", ["KarmaLightAPI", "HoudiniViewportLightAPI", "TyphoonLightAPI", "CyclesObjectSettingsAPI"])
def test_settings_of_other_renderers(schema: str) -> None:
    found = said(stage_of(f'def Sphere "s" (prepend apiSchemas = ["{schema}"])\n{{\n}}\n'))
    assert [(d.code, d.prim_path) for d in found] == [("foreign-schema", "/s")]


@pytest.mark.parametrize(
    ("schema", "says"),
    [
        ("HoudiniProceduralAPI:grow", "What its procedural would make is missing."),
        ("HoudiniLightBarnDoorAPI", "Barn doors"),
        ("PhysxParticleIsosurfaceAPI", "its particles is missing"),
        ("Physicsish", "is unknown"),
        ("Mjcat", "is unknown"),
    ],
)
def test_schemas_of_the_same_programs_that_would_change_it_are_warnings(schema: str, says: str) -> None:
    [found] = said(stage_of(f'def Sphere "s" (prepend apiSchemas = ["{schema}"])\n{{\n}}\n'))
    assert (found.code, found.is_strict) == ("api-schema", True)
    assert says in found.message


@pytest.mark.parametrize("shader", ["s", "r"])
def test_unknown_schemas_of_shaders(shader: str) -> None:
    text = """def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:roughness.connect = </m/r.outputs:result>
        token outputs:surface
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "p"
        float outputs:result
    }
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
}
"""
    stage = stage_of(text.replace(f'Shader "{shader}"', f'Shader "{shader}" (prepend apiSchemas = ["FancyAPI"])'))
    assert "api-schema" in [d.code for d in said(stage)]


FOREIGN = """def Sphere "a"
{
    int primvars:arnold:subdiv_iterations = 2
    bool primvars:arnold:opaque = 1
    custom string karma:object:tag = "x"
}
def Sphere "b"
{
    int primvars:arnold:subdiv_iterations = 2
}
def Camera "c"
{
    custom float ri:attributes:trace = 1
    custom string userProperties:note = "mine"
    custom float arnold = 1
}
"""


def test_namespaces_of_other_renderers_are_told_once() -> None:
    found = {d.attribute: d for d in said(stage_of(FOREIGN)) if d.code == "other-renderer"}
    assert set(found) == {"primvars:arnold:opaque", "karma:object:tag", "ri:attributes:trace"}
    assert found["primvars:arnold:opaque"].message == "2 attributes of the namespace arnold on 2 prims: ignored."
    assert found["karma:object:tag"].message == "An attribute of the namespace karma on this prim: ignored."
    assert [d.prim_path for d in found.values()] == ["/a", "/a", "/c"]


def test_namespaces_inside_prototypes_are_shown_by_an_instance() -> None:
    text = 'class "p"\n{\ndef Sphere "s"\n{\nint primvars:arnold:opaque = 1\n}\n}\n'
    text += "".join(f'def Xform "i{k}" (\n instanceable = true\n references = </p>\n)\n{{\n}}\n' for k in range(3))
    [found] = [d for d in said(stage_of(text)) if d.code == "other-renderer"]
    assert found.prim_path == "/i0/s"


LAMP = """def SphereLight "lamp"
{
    MORE
}
"""


@pytest.mark.parametrize(
    ("authored_text", "told"),
    [
        ("float inputs:intensity = 2", []),
        ("float inputs:sparkle = 2", [("unknown-input", "inputs:sparkle")]),
        ("float intensity = 2", [("old-attribute", "intensity")]),
        ("float intensity = 2\nfloat inputs:intensity = 2", []),  # for readers old and new
        ("float inputs:width = 2", [("unknown-input", "inputs:width")]),  # a RectLight's
        ("custom bool inputs:visibility:camera = 1", []),
        ("custom bool inputs:karma:light:x = 1", [("other-renderer", "inputs:karma:light:x")]),
    ],
)
def test_inputs_of_lights(authored_text: str, told: list[tuple[str, str]]) -> None:
    found = said(stage_of(LAMP.replace("MORE", authored_text)))
    assert [(d.code, d.attribute) for d in found] == told


def test_unknown_inputs_of_nodes(tmp_path: Path) -> None:
    text = """def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:shine = 1
        float inputs:roughness.connect = </m/t.outputs:r>
        token outputs:surface
    }
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @t.png@
        float inputs:sharpness = 1
        float2 inputs:st.connect = </m/x.outputs:result>
        float outputs:r
    }
    def Shader "x"
    {
        uniform token info:id = "UsdTransform2d"
        float inputs:skew = 1
        float2 inputs:in.connect = </m/r.outputs:result>
        float2 outputs:result
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        string inputs:name = "st"
        float2 outputs:result
    }
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
}
"""
    assert oiio.ImageBuf(oiio.ImageSpec(2, 2, 3, "uint8")).write(f"{tmp_path}/t.png")
    stage = stage_of(text.replace("@t.png@", f"@{tmp_path}/t.png@"))
    found = {(d.prim_path, d.attribute) for d in said(stage) if d.code == "unknown-input"}
    assert found == {("/m/s", "inputs:shine"), ("/m/t", "inputs:sharpness"), ("/m/x", "inputs:skew"), ("/m/r", "inputs:name")}


WITHOUT_EFFECT = [
    ("Gprim.doubleSided", "Sphere", [], "doubleSided", True),
    ("Plane.doubleSided", "Plane", [], "doubleSided", False),
    ("Points.ids", "Points", [], "ids", Vt.Int64Array([5, 6])),
    ("ListAPI.lightList", "Sphere", ["ListAPI"], "lightList", Sdf.Path("/x")),
    ("ListAPI.lightList:cacheBehavior", "Sphere", ["ListAPI"], "lightList:cacheBehavior", "ignore"),
    ("LightListAPI.lightList", "Sphere", ["LightListAPI"], "lightList", Sdf.Path("/x")),
    ("LightListAPI.lightList:cacheBehavior", "Sphere", ["LightListAPI"], "lightList:cacheBehavior", "ignore"),
]


@pytest.mark.parametrize(
    ("kind", "schemas", "name", "value"),
    [pytest.param(*rest, marks=pytest.mark.conforms(row, state="no effect"), id=row) for row, *rest in WITHOUT_EFFECT],
)
def test_what_has_no_effect_changes_nothing_and_is_not_told(kind: str, schemas: list[str], name: str, value: Any) -> None:
    def described(with_it: bool) -> str:
        applied = f"(prepend apiSchemas = {schemas})".replace("'", '"') if schemas else ""
        points = "point3f[] points = [(0, 0, 0), (2, 0, 0)]" if kind == "Points" else ""
        stage = stage_of(f'def {kind} "x" {applied}\n{{\n{points}\n}}\n')
        prim = stage.GetPrimAtPath("/x")
        if with_it and isinstance(value, Sdf.Path):
            assert prim.GetRelationship(name).AddTarget(value)
        elif with_it:
            assert prim.GetAttribute(name).IsDefined()
            assert prim.GetAttribute(name).Set(value)
        return describe(*translate(stage, RenderSettings()), "")

    assert described(True) == described(False)
