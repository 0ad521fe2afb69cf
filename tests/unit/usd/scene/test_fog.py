"""PrimrayFogAPI: on the default prim or the camera, its units, and what cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Sdf, Usd

import primray
from primray import RenderSettings
from primray.description import Fog
from primray.usd.scene.fog import NAMES
from primray.usd.translate import translate

SCHEMAS = Path(__file__).resolve().parents[4] / "schemas" / "usd"
FOG = """    float primray:fog:density = 2
    color3f primray:fog:color = (1, 0.5, 0.25)
    float primray:fog:anisotropy = 0.5
    color3f primray:fog:emission = (1, 2, 3)
    float primray:fog:top = 4
    float primray:fog:falloff = 5
"""
SKY = 'def DomeLight "sky" {\n}\n'


def stage_of(world: str = "", eye: str = "", more: str = "", axis: str = "Y") -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    text = f"""#usda 1.0
( defaultPrim = "World"
  metersPerUnit = 0.01
  upAxis = "{axis}" )
def Xform "World" (prepend apiSchemas = ["PrimrayFogAPI"]) {{
{world}}}
def Camera "eye" {{
{eye}}}
{more}"""
    assert stage.GetRootLayer().ImportFromString(text)
    return stage


def fog_of(world: str = "", eye: str = "", more: str = "", axis: str = "Y") -> tuple[Fog | None, list[tuple[str, str]]]:
    description, found = translate(stage_of(world, eye, more, axis), RenderSettings())
    return description.fog, [(d.code, d.attribute) for d in found if d.code not in ("default-light", "camera-chosen")]


def test_the_default_prim_has_it() -> None:
    found, said = fog_of(FOG, "", SKY)
    assert said == []
    assert found is not None
    assert (found.path, found.density, found.albedo, found.anisotropy) == ("/World", 0.02, (1, 0.5, 0.25), 0.5)
    assert found.emission == pytest.approx((0.01, 0.02, 0.03))
    assert (found.top, found.falloff, found.up) == (4.0, 5.0, (0.0, 1.0, 0.0))
    upright, _ = fog_of(FOG, "", SKY, axis="Z")
    assert upright is not None
    assert upright.up == (0.0, 0.0, 1.0)


def test_elsewhere_it_is_reported() -> None:
    elsewhere = f'def Xform "Set" (prepend apiSchemas = ["PrimrayFogAPI"]) {{\n{FOG}}}\n'
    found, said = fog_of("", "", elsewhere)
    assert found is None
    assert said == [("api-schema", "")]


def test_the_cameras_wins_as_a_whole() -> None:
    found, _ = fog_of(FOG, "    float primray:fog:density = 1\n    float primray:fog:top = 0\n")
    assert found is not None
    assert (found.path, found.density, found.albedo, found.falloff) == ("/eye", 0.01, (1, 1, 1), 0.0)
    assert fog_of(FOG, "    float primray:fog:density = 0\n")[0] is None


def test_there_is_none_where_nothing_asks_for_it() -> None:
    assert fog_of() == (None, [])
    assert fog_of("    float primray:fog:top = 3\n") == (None, [])


def test_fog_without_a_top_absorbs_a_little() -> None:
    found, _ = fog_of("    float primray:fog:density = 1\n")
    assert found is not None
    assert (found.top, found.albedo) == (None, (0.99, 0.99, 0.99))
    authored = "    float primray:fog:density = 1\n    color3f primray:fog:color = (1, 0.5, 0)\n"
    assert ("out-of-range", "primray:fog:color") in fog_of(authored)[1]


def test_fog_without_a_top_hides_what_is_infinitely_far() -> None:
    assert fog_of("    float primray:fog:density = 1\n", "", SKY)[1] == [("endless-fog", "primray:fog:top")]
    assert fog_of("    float primray:fog:density = 1\n", "", 'def SphereLight "lamp" {\n}\n')[1] == []


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("float primray:fog:density = -1", "out-of-range"),
        ("float primray:fog:falloff = -1", "out-of-range"),
        ("float primray:fog:anisotropy = 2", "out-of-range"),
        ("color3f primray:fog:color = (2, 1, 1)", "out-of-range"),
        ("string primray:fog:density = 'thick'", "wrong-type"),
        ("float primray:fog:hight = 3", "unknown-input"),
    ],
)
def test_what_cannot_be_is_reported(line: str, code: str) -> None:
    name = line.split()[1]
    base = "" if "density" in line else "    float primray:fog:density = 1\n"
    assert (code, name) in fog_of(f"{base}    {line}\n")[1]


def test_the_schema_has_what_is_read() -> None:
    layer = Sdf.Layer.FindOrOpen(str(SCHEMAS / "schema.usda"))
    prim = layer.GetPrimAtPath("/PrimrayFogAPI")
    assert {p.name for p in prim.properties} == NAMES


def test_an_edit_is_seen_by_a_kept_scene() -> None:
    ball = 'def Sphere "ball" {\n color3f[] primvars:displayColor = [(1, 1, 1)]\n}\n'
    eye = "    double3 xformOp:translate = (0, 0, 50)\n    uniform token[] xformOpOrder = ['xformOp:translate']\n"
    stage = stage_of(
        "    float primray:fog:top = 10\n", eye, ball + 'def SphereLight "lamp" {\n float inputs:intensity = 9\n}\n'
    )
    settings = RenderSettings(resolution=(8, 5), spp=2)
    kept = primray.Scene(stage)
    kept.render(settings)
    attribute = stage.GetPrimAtPath("/World").CreateAttribute("primray:fog:density", Sdf.ValueTypeNames.Float)
    for density in (10.0, 3.0, 0.0):
        attribute.Set(density)
        again, whole = kept.render(settings), primray.render(stage, settings)
        assert again.report["pixels_sha256"] == whole.report["pixels_sha256"]
    attribute.Set(5.0)
    kept.render(settings)
    stage.GetPrimAtPath("/lamp").GetAttribute("inputs:intensity").Set(4.0)
    assert kept.render(settings).report["pixels_sha256"] == primray.render(stage, settings).report["pixels_sha256"]


@pytest.mark.parametrize(
    ("line", "expected", "attribute"),
    [
        ('string primray:fog:top = "3"', "is not a finite number; the fog has no top", "top"),
        ("bool primray:fog:top = true", "is not a finite number; the fog has no top", "top"),
        ("rel primray:fog:top = </World>", "is a relationship; an attribute is expected", "top"),
        ("float primray:fog:top.connect = </World.height>", "is connected, which has no effect; a value is expected", "top"),
        ('token primray:fog:color = "red"', "is not 3 finite numbers", "color"),
        ("float[] primray:fog:falloff = [1]", "is not a finite number; 0 is used", "falloff"),
    ],
)
@pytest.mark.parametrize("api", [True, False])
def test_values_of_other_types_are_reported(line: str, expected: str, attribute: str, api: bool) -> None:
    stage = stage_of(f"    float primray:fog:density = 2\n    {line}\n")
    if not api:
        stage.GetPrimAtPath("/World").RemoveAppliedSchema("PrimrayFogAPI")
    description, found = translate(stage, RenderSettings())
    said = [(d.attribute, d.message) for d in found if d.code == "wrong-type"]
    assert [of for of, _ in said] == [f"primray:fog:{attribute}"]
    assert expected in said[0][1]
    assert description.fog is not None
    assert description.fog.top is None


def test_a_double_is_as_good_as_a_float() -> None:
    found, said = fog_of("    float primray:fog:density = 2\n    double primray:fog:top = 3\n")
    assert said == []
    assert found is not None
    assert found.top == 3


@pytest.mark.parametrize(("value", "is_reported"), [(0.98, False), (0.985, True), (-0.99, True), (2, True)])
def test_an_anisotropy_that_is_clamped_is_reported(value: float, is_reported: bool) -> None:
    fog = f"    float primray:fog:density = 2\n    float primray:fog:top = 3\n    float primray:fog:anisotropy = {value}\n"
    found, said = fog_of(fog)
    assert said == ([("out-of-range", "primray:fog:anisotropy")] if is_reported else [])
    assert found is not None
    assert abs(found.anisotropy) < 0.9801
