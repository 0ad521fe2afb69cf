"""Metadata of a stage that are of a wrong type: a diagnostic, and the picture of the default or of their number."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from primray.diagnostics import Diagnostics
from primray.errors import PrimrayError
from primray.settings import RenderSettings
from primray.usd import open_stage, stage_facts, translate

from ..wrong_types.crates import Crate, crate_of, words
from ..wrong_types.fields import STAGE_METADATA, base, of_stage
from ..wrong_types.tried import Outcomes, defects, tried

QUICK = ("float", "string", "int", "token[]")
# What changes neither picture nor times here, and is read by nobody.
UNREAD = {"kilogramsPerUnit"}
RIGHT = {("framePrecision", "int"), ("renderSettingsPrimPath", "string"), ("customLayerData", "dictionary")}
RIGHT |= {("expressionVariables", "dictionary"), ("colorConfiguration", "asset"), ("colorManagementSystem", "token")}
RIGHT |= {(name, "token") for name in ("upAxis", "defaultPrim", "renderSettingsPrimPath")}
RIGHT |= {
    (name, "double") for name in ("metersPerUnit", "startTimeCode", "endTimeCode", "timeCodesPerSecond", "framesPerSecond")
}
SIMPLE = '#usda 1.0\n(\n metersPerUnit = 0.25\n)\ndef Sphere "s"\n{\n}\n'


def written(folder: Path, kinds: tuple[str, ...]) -> Outcomes:
    for name, kind, crate in of_stage(base()):
        if kind in kinds:
            (folder / f"{name} {kind}.usdc").write_bytes(crate.data)
    return tried(folder)


def check(outcomes: Outcomes) -> None:
    assert defects(outcomes) == {}
    errors = {name: outcome["error"] for name, outcome in outcomes.items() if "error" in outcome}
    assert {name.split()[0] for name in errors} <= {"timeCodesPerSecond"}, "USD cannot open these"
    assert set(errors.values()) <= {"time-metadata"}
    told = {name for name, outcome in outcomes.items() if {"stage-metadata", "time-metadata"} & set(outcome.get("codes", ()))}
    silent = {tuple(name.split()) for name in outcomes.keys() - told - errors.keys()}
    assert {(name, kind) for name, kind in silent if name not in UNREAD} - RIGHT == set()


def test_each_is_told(tmp_path: Path) -> None:
    outcomes = written(tmp_path, QUICK)
    assert len(outcomes) == len(QUICK) * len(STAGE_METADATA)
    check(outcomes)


@pytest.mark.long
def test_each_of_every_type_is_told(tmp_path: Path) -> None:
    check(written(tmp_path, tuple(words())))


def with_length(kind: str) -> Crate:
    crate = crate_of(SIMPLE)
    at = crate.fields.index(b"metersPerUnit")
    return crate.with_values([words()[kind] if i == at else value for i, value in enumerate(crate.values)])


@pytest.mark.parametrize(("kind", "used"), [("float", 0.5), ("int", 7.0), ("string", 0.01), ("bool", 0.01), ("float[]", 0.01)])
def test_a_length_that_is_a_number_is_used(kind: str, used: float, tmp_path: Path) -> None:
    (tmp_path / "a.usdc").write_bytes(with_length(kind).data)
    diagnostics = Diagnostics()
    stage = open_stage(tmp_path / "a.usdc", diagnostics)
    description, translating = translate(stage, RenderSettings())
    assert description.meters_per_unit == used
    assert stage_facts(stage)["meters_per_unit"] == used
    (told,) = [d for d in translating if d.code == "stage-metadata"]
    assert told.attribute == "metersPerUnit"
    assert f"{used:g} is used" in told.message


@pytest.mark.parametrize("command", ["inspect", "render"])
def test_the_commands_say_so_and_go_on(command: str, tmp_path: Path) -> None:
    from primray.cli.app import app

    (tmp_path / "a.usdc").write_bytes(with_length("float").data)
    size = [str(tmp_path / "a.png"), "-r", "8", "8", "-p", "1"] if command == "render" else ["--json"]
    done = CliRunner().invoke(app, [command, str(tmp_path / "a.usdc"), *size])
    assert done.exit_code == 0, done.output
    assert "stage-metadata" in done.output


def test_a_rate_that_is_no_number_is_an_error(tmp_path: Path) -> None:
    crate = crate_of("#usda 1.0\n(\n timeCodesPerSecond = 25\n)\n")
    at = crate.fields.index(b"timeCodesPerSecond")
    (tmp_path / "a.usdc").write_bytes(
        crate.with_values([words()["bool"] if i == at else v for i, v in enumerate(crate.values)]).data
    )
    with pytest.raises(PrimrayError, match="timeCodesPerSecond is True, not a number") as caught:
        open_stage(tmp_path / "a.usdc", Diagnostics())
    assert caught.value.code == "time-metadata"
