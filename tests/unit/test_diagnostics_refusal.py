"""Which diagnostics refuse a stage, by the settings and by the flags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import primray
from primray import RenderSettings
from primray.cli import run
from primray.diagnostic_codes import CODES, Kind, Severity
from primray.diagnostics import GROUPS, Diagnostic, Refusal
from primray.errors import SettingsError, UnsupportedError
from primray.settings.render_settings import with_values

MATERIAL = """
def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>
        token outputs:surface
    }
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @none.png@
        float3 outputs:rgb
    }
}
"""
WITHOUT_TEXTURE = f"""#usda 1.0
def Sphere "s" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    rel material:binding = </m>
}}
{MATERIAL}"""
WITHOUT_REFERENCE = """#usda 1.0
def Xform "a" (
    references = @./nowhere.usda@
)
{
}
"""
FLAT_AT_3 = """
def Sphere "flat"
{
    float3 xformOp:scale.timeSamples = {
        1: (1, 1, 1),
        2: (1, 1, 1),
        3: (0, 1, 1),
    }
    uniform token[] xformOpOrder = ["xformOp:scale"]
}
"""
SMALL = ["--res", "16", "9", "--spp", "2"]


@pytest.mark.parametrize("code", CODES)
def test_every_code_can_be_refused_and_allowed(code: str) -> None:
    def flag(**settings: Any) -> str | None:
        found = Diagnostic(CODES[code].severity, code, "/a", "as it is")
        return Refusal(**settings).flag(code, found.is_strict)

    assert flag(fail_on=(code,)) == "--fail-on"
    assert flag(strict=True, fail_on=(code,), allow=(code,)) is None
    changes = CODES[code].severity is not Severity.INFO and CODES[code].kind.changes_picture
    assert flag(strict=True) == ("--strict" if changes else None)
    assert flag() is None


def test_groups_hold_codes_of_what_is_missing() -> None:
    for codes in GROUPS.values():
        assert {CODES[code].kind for code in codes} == {Kind.MISSING}
    assert not set(GROUPS) & set(CODES)


@pytest.mark.parametrize("name", ["fail_on", "allow"])
def test_a_code_that_there_is_not_is_an_error(name: str) -> None:
    with pytest.raises(SettingsError, match="did you mean asset-missing") as error:
        with_values(RenderSettings(), {name: ["asset-mising"]})
    assert (error.value.where, error.value.code) == (name, "unknown-diagnostic")


@pytest.mark.parametrize(
    ("text", "flags", "code"),
    [
        (WITHOUT_TEXTURE, [], 0),
        (WITHOUT_TEXTURE, ["--fail-on", "missing"], 3),
        (WITHOUT_TEXTURE, ["--fail-on", "motion,asset-missing"], 3),
        (WITHOUT_TEXTURE, ["--fail-on", "motion"], 0),
        (WITHOUT_TEXTURE, ["--fail-on", "missing", "--allow", "asset-missing"], 0),
        (WITHOUT_TEXTURE, ["--strict"], 3),
        (WITHOUT_TEXTURE, ["--strict", "--allow", "missing"], 0),
        (WITHOUT_TEXTURE, ["--strict", "--allow", "mising"], 2),
        (WITHOUT_REFERENCE, [], 3),
        (WITHOUT_REFERENCE + 'def Sphere "s" {}\n', [], 0),
        (WITHOUT_REFERENCE + 'def Sphere "s" {}\n', ["--fail-on", "missing"], 3),
        (WITHOUT_REFERENCE + 'def DomeLight "d" {}\n', [], 3),
        (WITHOUT_REFERENCE, ["--allow", "missing"], 0),
    ],
)
def test_a_render_fails_for_what_it_is_to_fail_for(
    text: str, flags: list[str], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("shot.usda").write_text(text)
    assert run(["render", "shot.usda", *SMALL, *flags]) == code
    assert Path("shot.exr").exists() == (code == 0)


def test_inspect_fails_alike(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "shot.usda").write_text(WITHOUT_TEXTURE)
    assert run(["inspect", str(tmp_path / "shot.usda")]) == 0
    assert run(["inspect", str(tmp_path / "shot.usda"), "--fail-on", "missing"]) == 3
    assert "--fail-on: asset-missing" in capsys.readouterr().err


def test_the_library_says_which_flag_refuses(tmp_path: Path) -> None:
    (tmp_path / "shot.usda").write_text(WITHOUT_TEXTURE)
    with pytest.raises(UnsupportedError, match="asset-missing") as error:
        primray.render(tmp_path / "shot.usda", resolution=(16, 9), spp=1, fail_on=["missing"])
    assert error.value.code == "fail-on"


@pytest.mark.parametrize("flags", [["--strict"], ["--fail-on", "unsampled-pixels"]])
def test_what_came_up_while_sampling_is_refused_after_the_picture_is_written(
    flags: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("shot.usda").write_text('#usda 1.0\ndef Sphere "s" {}\n')
    assert run(["render", "shot.usda", "--res", "1024", "1024", "--time-limit", "0.001", *flags]) == 3
    assert "unsampled-pixels" in capsys.readouterr().err
    assert Path("shot.exr").exists()


def test_warnings_of_a_sequence_are_shown_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("shot.usda").write_text(WITHOUT_TEXTURE + FLAT_AT_3)
    assert run(["render", "shot.usda", *SMALL, "--frames", "1:3"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert sum("none.png cannot be found" in line for line in lines) == 1
    assert "error: asset-missing (missing): in 3 of 3 frames" in lines
    assert "error: singular-transform (missing): in 1 of 3 frames" in lines
    capsys.readouterr()
    assert run(["render", "shot.usda", *SMALL, "--frames", "1"]) == 0
    assert " frames" not in capsys.readouterr().err
