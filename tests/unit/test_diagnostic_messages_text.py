"""Diagnostics as text: what many prims have in common is said once, what differs is cut short, nothing is lost in JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from primray.cli import run
from primray.diagnostic_messages import diagnostics_lines, fidelity_text
from primray.diagnostics import Diagnostics


def rows(*found: tuple[str, str, str, str]) -> list[dict[str, str]]:
    diagnostics = Diagnostics()
    for code, path, message, attribute in found:
        diagnostics.add(code, path, message, attribute)
    return [each.as_json() for each in diagnostics]


def test_what_many_have_in_common_is_said_once() -> None:
    many = rows(*(("unsupported-prim", f"/hair_{k}", "GenerativeProcedural is not rendered.", "") for k in range(5000)))
    assert diagnostics_lines(many) == [
        "error: unsupported-prim (missing): GenerativeProcedural is not rendered. (5,000 times)",
        "    /hair_0, /hair_1, /hair_2 and 4,997 more",
    ]
    assert diagnostics_lines(many, verbose=True)[1].count("/hair_") == 5000


def test_messages_that_differ_are_cut_short() -> None:
    many = rows(*(("faces-dropped", f"/m_{k}", f"{k} of 5000 faces.", "faceVertexIndices") for k in range(1000)))
    lines = diagnostics_lines(many)
    assert lines[0] == "error: faces-dropped (missing): faceVertexIndices: 0 of 5000 faces."
    assert lines[1] == "    /m_0"
    assert lines[-2] == "error: faces-dropped (missing): faceVertexIndices: and 997 more of this kind"
    assert lines[-1] == "    /m_3, /m_4, /m_5 and 994 more"
    assert len(lines) == 8
    assert len(diagnostics_lines(many, verbose=True)) == 2000


def test_attributes_of_one_prim_are_told_apart() -> None:
    lines = diagnostics_lines(
        rows(("wrong-type", "/a", "It is no number.", "radius"), ("wrong-type", "/a", "It is no number.", "height"))
    )
    assert lines[::2] == [
        "warning: wrong-type (defaulted): height: It is no number.",
        "warning: wrong-type (defaulted): radius: It is no number.",
    ]


@pytest.mark.parametrize(
    ("attribute", "message", "said"),
    [
        ("inputs:roughness", "roughness = 3 is clamped.", "inputs:roughness = 3 is clamped."),
        ("inputs:intensity", "inputs:intensity = inf is no number.", "inputs:intensity = inf is no number."),
        ("normals", "normals (vertex) has 1 value.", "normals (vertex) has 1 value."),
        ("inputs:file", "a.png cannot be found.", "inputs:file: a.png cannot be found."),
        ("", "It has no faces.", "It has no faces."),
    ],
)
def test_the_attribute_is_said_once(attribute: str, message: str, said: str) -> None:
    assert diagnostics_lines(rows(("invalid-primvar", "/a", message, attribute)))[0].endswith(f"(ignored): {said}")


def test_what_costs_most_comes_first() -> None:
    found = rows(
        ("camera-chosen", "/c", "chosen", ""),
        ("wrong-type", "/b", "defaulted", ""),
        ("motion", "/b", "ignored", ""),
        ("asset-missing", "/a", "missing", ""),
    )
    assert [line.split(": ")[1] for line in diagnostics_lines(found)[::2]] == [
        "asset-missing (missing)",
        "motion (ignored)",
        "wrong-type (defaulted)",
        "camera-chosen (chosen)",
    ]
    assert fidelity_text(found) == "1 missing, 1 ignored, 1 defaulted"
    assert fidelity_text(found[:1]) == "as authored"


def test_rows_of_older_reports_have_neither_kind_nor_attribute() -> None:
    old = [{"severity": "warning", "code": "motion", "prim_path": "/a", "message": "m"}]
    assert diagnostics_lines(old) == ["warning: motion: m", "    /a"]


STAGE = """#usda 1.0
def Camera "cam"
{
    float2 clippingRange = (0.1, 100)
}
def Sphere "ball" (prepend apiSchemas = ["FancyAPI"])
{
    double radius = inf
    int primvars:arnold:opaque = 1
}
def DomeLight "sky"
{
}
"""


@pytest.fixture
def stage(tmp_path: Path) -> str:
    curves = "".join(f'def GenerativeProcedural "hair_{k}"\n{{\n}}\n' for k in range(50))
    (tmp_path / "many.usda").write_text(STAGE + curves)
    return str(tmp_path / "many.usda")


def test_inspect_tells_a_person(stage: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", stage]) == 0
    out = capsys.readouterr().out.splitlines()
    [fidelity] = [line for line in out if line.startswith("fidelity")]
    assert fidelity.split(maxsplit=1)[1] == "50 missing, 1 ignored, 1 defaulted"
    assert out[out.index(fidelity) + 1 :] == [
        "error: unsupported-prim (missing): GenerativeProcedural is not rendered. (50 times)",
        "    /hair_0, /hair_1, /hair_2 and 47 more",
        "warning: api-schema (ignored): FancyAPI is unknown: any effect on the picture is ignored.",
        "    /ball",
        "warning: wrong-type (defaulted): radius = inf is not a finite number; 1 is used.",
        "    /ball",
        "info: other-renderer (ignored): primvars:arnold:opaque: An attribute of the namespace arnold on this prim: ignored.",
        "    /ball",
        "info: camera-chosen (chosen): The stage's only camera is used.",
        "    /cam",
    ]


def test_inspect_tells_programs_everything(stage: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", stage, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["diagnostics"]
    assert sum(row["code"] == "unsupported-prim" for row in found) == 50
    assert all(set(row) == {"severity", "kind", "code", "prim_path", "attribute", "message"} for row in found)
    assert {(row["prim_path"], row["attribute"], row["kind"]) for row in found} >= {("/ball", "radius", "defaulted")}


def test_strict_inspection_prints_and_fails(stage: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", stage, "--strict"]) == 3
    captured = capsys.readouterr()
    assert "fidelity" in captured.out
    assert captured.err.startswith(
        "error: unsupported-prim (missing): GenerativeProcedural is not rendered. (50 times)"
    )  # all of them
    assert "\nerror: strict: --strict: api-schema: FancyAPI is unknown" in captured.err
    assert captured.err.endswith("(and 51 more) [/ball]\n")
    fine = tmp_path / "fine.usda"
    fine.write_text(STAGE.replace("FancyAPI", "PhysicsMassAPI").replace("inf", "2"))
    assert run(["inspect", str(fine), "--strict"]) == 0
    unknown = tmp_path / "unknown.usda"
    unknown.write_text(STAGE.replace("inf", "2"))
    assert run(["inspect", str(unknown), "--strict"]) == 3
    assert "FancyAPI" in capsys.readouterr().err
