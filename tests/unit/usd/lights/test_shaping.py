"""ShapingAPI's attributes as the seam has them, their files and their diagnostics."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd, UsdUtils

from primray.description import Light, LightType, Shaping
from primray.diagnostics import Diagnostic
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

PROFILE = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 2 3 1 1 2 0 0 0\n1 1 50\n0 45 90\n0\n100 50 0\n"


def translated(stage: Usd.Stage) -> tuple[Light, list[Diagnostic]]:
    description, diagnostics = translate(stage, RenderSettings())
    (only,) = description.lights
    return only, list(diagnostics)


def light(body: str, kind: str = "SphereLight", applied: bool = True) -> tuple[Light, list[Diagnostic]]:
    schema = ' (prepend apiSchemas = ["ShapingAPI"])' if applied else ""
    return translated(stage_of(f'def {kind} "light"{schema}\n{{\n{body}\n}}\n'))


def shaping(body: str, kind: str = "SphereLight", applied: bool = True) -> Shaping | None:
    found, diagnostics = light(body, kind, applied)
    assert [d for d in diagnostics if d.prim_path == "/light"] == []
    return found.shaping


def noted(body: str, kind: str = "SphereLight", applied: bool = True) -> set[tuple[str, str]]:
    return {(d.code, d.attribute) for d in light(body, kind, applied)[1] if d.prim_path == "/light"}


def test_the_default_cone_of_90_degrees_counts_where_the_schema_is_applied() -> None:
    assert shaping("") == Shaping(cone_angle_deg=90.0)
    assert shaping("", applied=False) is None
    assert shaping("float inputs:shaping:focus = 2", applied=False) == Shaping(focus=2.0)
    assert shaping("float inputs:shaping:cone:angle = 180") is None


def test_flat_lights_lose_nothing_to_a_cone_of_90_degrees() -> None:
    assert shaping("", "RectLight") is None
    assert shaping("", "DiskLight") is None
    assert shaping("", "CylinderLight") == Shaping(cone_angle_deg=90.0)
    sheared = "matrix4d xformOp:transform = ((1,0,0,0),(0,1,0,0),(0.5,0,1,0),(0,0,0,1))\n"
    sheared += 'uniform token[] xformOpOrder = ["xformOp:transform"]'
    assert shaping(sheared, "RectLight") == Shaping(cone_angle_deg=90.0)
    assert shaping("float inputs:shaping:cone:angle = 89", "RectLight") == Shaping(cone_angle_deg=89.0)


@pytest.mark.parametrize("kind", ["SphereLight", "DiskLight", "RectLight", "CylinderLight"])
def test_all_of_its_numbers(kind: str) -> None:
    body = (
        "float inputs:shaping:focus = 3\ncolor3f inputs:shaping:focusTint = (0.5, 0.25, 1.5)\n"
        "float inputs:shaping:cone:angle = 35\nfloat inputs:shaping:cone:softness = 0.5\n"
    )
    assert shaping(body, kind) == Shaping(3.0, (0.5, 0.25, 1.5), 35.0, 0.5)
    assert shaping("float inputs:shaping:focus = 3\ncolor3f inputs:shaping:focusTint = (1, 1, 1)", applied=False) is None


def test_points_and_lines_are_shaped() -> None:
    point, _ = light("bool treatAsPoint = 1\nfloat inputs:shaping:cone:angle = 35")
    assert (point.type, point.shaping) == (LightType.POINT, Shaping(cone_angle_deg=35.0))
    line, _ = light("bool treatAsLine = 1\nfloat inputs:shaping:cone:angle = 35", "CylinderLight")
    assert (line.type, line.shaping) == (LightType.LINE, Shaping(cone_angle_deg=35.0))


def test_values_out_of_range_name_their_attribute() -> None:
    wide = "float inputs:shaping:cone:angle = 180\n"
    assert noted(wide + "float inputs:shaping:focus = -1") == {("light-input", "inputs:shaping:focus")}
    assert noted(wide + "float inputs:shaping:cone:softness = 1.5") == {("out-of-range", "inputs:shaping:cone:softness")}
    assert noted(wide + "color3f inputs:shaping:focusTint = (0, -1, 0)") == {("out-of-range", "inputs:shaping:focusTint")}
    assert noted("float inputs:shaping:cone:angle = 0") == {("light-dark", "inputs:shaping:cone:angle")}
    assert {code for code, _ in noted("float inputs:shaping:cone:angle = nan")} == {"wrong-type"}
    soft, _ = light(wide + "float inputs:shaping:cone:softness = 1.5")
    assert soft.shaping == Shaping(cone_softness=1.0)


def test_shaping_does_not_apply_to_distant_lights_and_domes() -> None:
    for kind in ("DistantLight", "DomeLight", "DomeLight_1"):
        assert shaping("", kind) is None
        assert noted("float inputs:shaping:cone:angle = 30", kind) == {("light-input", "inputs:shaping:cone:angle")}
        assert noted("float inputs:shaping:focus = 3", kind, applied=False) == {("light-input", "inputs:shaping:focus")}


def with_file(
    folder: Path, content: str | bytes | None, body: str = "", name: str = "lamp.ies"
) -> tuple[Light, list[Diagnostic]]:
    if content is not None:
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    stage = folder / "stage.usda"
    stage.write_text(
        '#usda 1.0\n(\n    upAxis = "Y"\n)\ndef SphereLight "light" (prepend apiSchemas = ["ShapingAPI"])\n{\n'
        f"float inputs:shaping:cone:angle = 180\nasset inputs:shaping:ies:file = @./{name}@\n{body}\n}}\n"
    )
    return translated(Usd.Stage.Open(str(stage)))


def test_a_profile(tmp_path: Path) -> None:
    found, diagnostics = with_file(
        tmp_path, PROFILE, "float inputs:shaping:ies:angleScale = -0.5\nbool inputs:shaping:ies:normalize = 1"
    )
    assert found.shaping is not None
    assert found.shaping.ies is not None
    assert found.shaping.ies.candela.tolist() == [[200, 100, 0]]
    assert (found.shaping.ies_angle_scale, found.shaping.ies_normalize) == (-0.5, True)
    assert [d for d in diagnostics if d.prim_path == "/light"] == []


@pytest.mark.parametrize(
    ("content", "code", "words"),
    [
        (None, "asset-missing", "cannot be found"),
        ("hello", "light-input", "no line begins with TILT="),
        (PROFILE.replace("50 0", "50 x"), "light-input", "line 7: 'x' is not a number"),
        (bytes(17 << 20), "light-input", "more than 16777216"),
        (PROFILE.replace("100 50 0", "0 0 0"), "light-dark", "no intensity above 0"),
        (PROFILE.replace("100 50 0", "100 -50 0"), "light-input", "negative"),
    ],
)
def test_what_is_wrong_with_a_profile_is_told(tmp_path: Path, content: str | bytes | None, code: str, words: str) -> None:
    found, diagnostics = with_file(tmp_path, content, "bool inputs:shaping:ies:normalize = 1")
    (only,) = [d for d in diagnostics if d.prim_path == "/light"]
    assert (only.code, only.attribute) == (code, "inputs:shaping:ies:file")
    assert words in only.message
    if content is None or words.startswith(("no line", "line", "more")):
        assert found.shaping is None


def test_a_profile_inside_a_package(tmp_path: Path) -> None:
    with_file(tmp_path, PROFILE)
    package = tmp_path / "scene.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "stage.usda"), str(package))
    (tmp_path / "lamp.ies").unlink()
    found, diagnostics = translated(Usd.Stage.Open(str(package)))
    assert found.shaping is not None
    assert found.shaping.ies is not None
    assert found.shaping.ies.candela.tolist() == [[200, 100, 0]]
    assert [d for d in diagnostics if d.prim_path == "/light"] == []


def test_a_profile_is_among_the_stage_s_files_and_in_its_fingerprint(tmp_path: Path) -> None:
    from primray.checkpoints.fingerprint import fingerprint
    from primray.usd.inspect.dependencies import dependencies

    def digest(content: str) -> str:
        with_file(tmp_path, content)
        return fingerprint(translate(Usd.Stage.Open(str(tmp_path / "stage.usda")), RenderSettings())[0], {})["lights"]

    first = digest(PROFILE)
    assert str(tmp_path / "lamp.ies") in dependencies(str(tmp_path / "stage.usda")).files
    assert digest(PROFILE) == first
    assert digest(PROFILE.replace("50 0", "51 0")) != first


def test_lights_share_what_a_file_holds(tmp_path: Path) -> None:
    (tmp_path / "lamp.ies").write_text(PROFILE)
    lights = "".join(f'def SphereLight "l{i}"\n{{\nasset inputs:shaping:ies:file = @./lamp.ies@\n}}\n' for i in range(3))
    (tmp_path / "stage.usda").write_text('#usda 1.0\n(\n    upAxis = "Y"\n)\n' + lights)
    found = translate(Usd.Stage.Open(str(tmp_path / "stage.usda")), RenderSettings())[0].lights
    profiles = [x.shaping.ies for x in found if x.shaping]
    assert len(profiles) == 3
    assert profiles[0] is profiles[1] is profiles[2]


def test_emission_stays_finite_under_a_bright_profile(tmp_path: Path) -> None:
    found, diagnostics = with_file(tmp_path, PROFILE, "float inputs:exposure = 1000")
    assert found.emission[0] == pytest.approx(1e30 / 200)
    assert "is clamped to" in next(d.message for d in diagnostics if d.prim_path == "/light")
