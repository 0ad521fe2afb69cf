"""Session layers: whatever a stage is composed anew for, it is the stage that pxr opens with that very session layer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pxr import Sdf, Usd

import primray
from primray.composition import Composition
from primray.diagnostics import Diagnostics
from primray.live.viewed_scene import ViewedScene
from primray.settings import RenderSettings
from primray.usd import open_stage, translate
from primray.usd.stage.metadata import layer_names
from primray.usd.stage.open import scratch_copy

SHOT = """#usda 1.0
(
    defaultPrim = "ball"
    startTimeCode = 1
    expressionVariables = {
        string KIND = "cube"
        string OF_ROOT = "root"
    }
    ROOT_RATE
)
def Xform "ball" (
    references = @`"./${KIND}.usda"`@
    variants = {
        string size = "small"
    }
    prepend variantSets = "size"
)
{
    variantSet "size" = {
        "big" {
        }
        "small" {
        }
    }
    double x.timeSamples = { 0: 0, 24: 24 }
    double y
}
"""
SESSION = """#usda 1.0
(
    METADATA
)
over "ball"
{
    double y.timeSamples = { 0: 0, 24: 24 }
}
"""
METADATA = {
    "variables": 'expressionVariables = {\n string KIND = "sphere"\n string OF_SESSION = "session"\n}',
    "rate": "timeCodesPerSecond = 48",
    "frames": "framesPerSecond = 30",
    "range": "startTimeCode = 3\nendTimeCode = 8",
    "units": 'metersPerUnit = 2\nupAxis = "Z"',
    "settings": 'renderSettingsPrimPath = "/Render/s"',
    "colors": 'colorManagementSystem = "ocio"',
    "data": 'customLayerData = {\n dictionary a = {\n  int b = 1\n }\n}\nfallbackPrimTypes = {\n token[] New = ["Sphere"]\n}',
    "prim": 'defaultPrim = "other"\ndoc = "words"',
}
NAMES = [
    *(
        "expressionVariables",
        "timeCodesPerSecond",
        "framesPerSecond",
        "startTimeCode",
        "endTimeCode",
        "metersPerUnit",
        "upAxis",
    ),
    *(
        "renderSettingsPrimPath",
        "colorManagementSystem",
        "customLayerData",
        "fallbackPrimTypes",
        "defaultPrim",
        "documentation",
    ),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, kind in (("cube", "Cube"), ("sphere", "Sphere")):
        (tmp_path / f"{name}.usda").write_text(
            f'#usda 1.0\n(\n defaultPrim = "g"\n)\ndef Xform "g"\n{{\n def {kind} "shape"\n {{\n }}\n}}\n'
        )
    return tmp_path


def written(folder: Path, metadata: str, root_rate: str = "") -> tuple[str, str]:
    (folder / "shot.usda").write_text(SHOT.replace("ROOT_RATE", root_rate))
    (folder / "session.usda").write_text(SESSION.replace("METADATA", metadata))
    return str(folder / "shot.usda"), str(folder / "session.usda")


def said(stage: Usd.Stage) -> dict[str, Any]:
    """What the stage is, as far as a session layer's metadata have to do with it."""
    samples = {name: stage.GetAttributeAtPath(f"/ball.{name}").GetTimeSamples() for name in "xy"}
    prims = [(str(prim.GetPath()), str(prim.GetTypeName())) for prim in stage.Traverse()]
    metadata = {name: stage.GetMetadata(name) for name in NAMES}
    return {**metadata, "default": stage.GetDefaultPrim().GetPath(), "prims": prims, **samples}


def by_path(root: str, session: str) -> Usd.Stage:
    return open_stage(root, Diagnostics(), Composition(session_layer=session))


def of_a_caller(root: str, session: str) -> Usd.Stage:
    stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(root), Sdf.Layer.FindOrOpen(session))
    return open_stage(stage, Diagnostics(), Composition(variants=("/ball:size=big",)))


def copied(root: str, session: str) -> Usd.Stage:
    return scratch_copy(Usd.Stage.Open(Sdf.Layer.FindOrOpen(root), Sdf.Layer.FindOrOpen(session)))


def copied_twice(root: str, session: str) -> Usd.Stage:
    return scratch_copy(scratch_copy(by_path(root, session)))


@pytest.mark.parametrize("root_rate", ["", "timeCodesPerSecond = 96", "framesPerSecond = 12"])
@pytest.mark.parametrize("how", [by_path, of_a_caller, copied, copied_twice])
@pytest.mark.parametrize("metadata", [*METADATA.values(), "\n".join(METADATA.values())], ids=[*METADATA, "all"])
def test_metadata_count_as_pxr_counts_them(
    metadata: str, how: Callable[[str, str], Usd.Stage], root_rate: str, folder: Path
) -> None:
    root, session = written(folder, metadata, root_rate)
    expected = said(Usd.Stage.Open(Sdf.Layer.FindOrOpen(root), Sdf.Layer.FindOrOpen(session)))
    assert said(how(root, session)) == expected


def test_a_session_layer_over_a_callers_own(folder: Path) -> None:
    root, own = written(folder, "\n".join(METADATA.values()))
    over = folder / "over.usda"
    over.write_text(
        '#usda 1.0\n(\n metersPerUnit = 5\n expressionVariables = {\n  string KIND = "cube"\n  string MORE = "more"\n }\n'
        " customLayerData = {\n  dictionary a = {\n   int c = 2\n  }\n }\n)\n"
    )
    stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(root), Sdf.Layer.FindOrOpen(own))
    found = open_stage(stage, Diagnostics(), Composition(session_layer=str(over)))
    both = Usd.Stage.Open(Sdf.Layer.FindOrOpen(own), Sdf.Layer.FindOrOpen(str(over)))  # pxr composes the two alone
    for name in NAMES:
        if name not in ("defaultPrim", "expressionVariables"):
            assert found.GetMetadata(name) == both.GetMetadata(name), name
    assert found.GetMetadata("expressionVariables") == {**both.GetMetadata("expressionVariables"), "OF_ROOT": "root"}
    assert found.GetPrimAtPath("/ball/shape").GetTypeName() == "Cube"


def test_asset_paths_lead_where_they_did(folder: Path) -> None:
    (folder / "elsewhere").mkdir()
    root, _ = written(folder, "")
    session = folder / "elsewhere/session.usda"
    session.write_text("#usda 1.0\n(\n colorConfiguration = @./config.ocio@\n)\n")
    found = by_path(root, str(session)).GetColorConfiguration().path
    assert found == str(folder / "elsewhere/config.ocio")


def test_a_muted_session_layer_counts_as_in_pxr(folder: Path) -> None:
    root, session = written(folder, "\n".join(METADATA.values()))
    stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(root), Sdf.Layer.FindOrOpen(session))
    stage.MuteLayer(stage.GetSessionLayer().identifier)
    found, expected = said(scratch_copy(stage)), said(stage)
    # What pxr says of the variables and what it composes by are two things here; the composition counts.
    del found["expressionVariables"], expected["expressionVariables"]
    assert found == expected


def test_a_stage_without_a_session_layer() -> None:
    stage = Usd.Stage.CreateInMemory("none.usda", None)
    assert not stage.GetSessionLayer()
    stage.DefinePrim("/s", "Sphere")
    made = scratch_copy(stage)
    assert made.GetPrimAtPath("/s").GetTypeName() == "Sphere"


def test_its_render_settings_are_taken(folder: Path) -> None:
    root, session = written(folder, 'renderSettingsPrimPath = "/Render/b"')
    text = Path(root).read_text() + 'def Camera "eye"\n{\n}\ndef Scope "Render"\n{\n'
    for name, width in (("a", 40), ("b", 60)):
        text += f' def RenderSettings "{name}"\n {{\n  int2 resolution = ({width}, 30)\n }}\n'
    Path(root).write_text(text + "}\n")
    Sdf.Layer.FindOrOpen(root).Reload(force=True)
    description, _ = translate(by_path(root, session), RenderSettings())
    assert description.frame.resolution == (60, 30)


def test_kept_scenes_follow_edits_of_its_metadata(folder: Path) -> None:
    root, session = written(folder, METADATA["variables"])
    scene = primray.Scene(root, session_layer=session)
    quick = RenderSettings(resolution=(16, 12), spp=1)

    def same_as_a_new_one() -> bool:
        new = primray.render(root, RenderSettings(resolution=(16, 12), spp=1, session_layer=session))
        return bool((scene.render(quick).pixels == new.pixels).all())

    assert same_as_a_new_one()
    before = scene.render(quick).pixels
    layer = Sdf.Layer.FindOrOpen(session)
    layer.expressionVariables = {"KIND": "cube"}
    assert same_as_a_new_one()
    assert (scene.render(quick).pixels != before).any()
    layer.ClearExpressionVariables()
    layer.pseudoRoot.SetInfo("upAxis", "Z")
    assert same_as_a_new_one()
    assert scene.stage.GetMetadata("expressionVariables")["KIND"] == "cube"


def test_documents_named_by_its_variables(folder: Path) -> None:
    root, session = written(folder, 'expressionVariables = {\n string LOOK = "b"\n}')
    for name in "ab":
        (folder / f"{name}.mtlx").write_text(
            f'<materialx version="1.39"><open_pbr_surface name="s_{name}" type="surfaceshader"/>'
            f'<surfacematerial name="m_{name}" type="material">'
            f'<input name="surfaceshader" type="surfaceshader" nodename="s_{name}"/></surfacematerial></materialx>'
        )
    Path(root).write_text(
        '#usda 1.0\n(\n expressionVariables = {\n  string LOOK = "a"\n }\n)\n'
        'def "looks" (\n references = @`"./${LOOK}.mtlx"`@</MaterialX>\n)\n{\n}\n'
    )
    Sdf.Layer.FindOrOpen(root).Reload(force=True)
    stage = by_path(root, session)
    assert stage.GetPrimAtPath("/looks/Materials/m_b")
    assert not stage.GetPrimAtPath("/looks/Materials/m_a")


def test_files_that_it_leads_to_are_watched(folder: Path) -> None:
    root, session = written(folder, METADATA["variables"])
    scene = ViewedScene(root, RenderSettings(session_layer=session, resolution=(16, 12)))
    scene.open()
    assert {root, session, str(folder / "sphere.usda")} <= scene.files()


def test_layers_of_a_stage_name_the_session_layer_and_not_what_hands_it_on(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text('#usda 1.0\ndef "A" {\n}\n')
    (tmp_path / "s.usda").write_text('#usda 1.0\nover "A" {\n}\n')
    stage = open_stage(tmp_path / "a.usda", Diagnostics(), Composition(session_layer=str(tmp_path / "s.usda")))
    assert [Path(name).name for name in layer_names(stage)] == ["s.usda", "a.usda"]
