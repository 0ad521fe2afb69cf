"""docs/from-usdrecord-and-husk.md is what the parser does: what it lists as understood is read, what it lists as refused is."""

from __future__ import annotations

import pytest
from typer.main import get_command

from primray.cli import run
from primray.cli.app import app
from primray.cli.foreign_command_lines import COMMANDS, DONE_ANYWAY, REFUSED, translate_foreign_flags

from .foreign import PAGE, TABLES, Refused, Understood, marks, spellings, with_tables

ROWS = [(tool, row) for tool, rows in TABLES.items() for row in rows]
UNDERSTOOD = [(flag, row.values) for _, row in ROWS if isinstance(row, Understood) for flag in spellings(row)]
OTHERWISE = [(flag, row.values) for _, row in ROWS if isinstance(row, Refused) for flag in spellings(row)]
TEXT = PAGE.read_text(encoding="utf-8")


def flags_of(command: str) -> set[str]:
    found = get_command(app).get_command(None, command)  # type: ignore[attr-defined]
    return {flag for param in found.params for flag in (*param.opts, *param.secondary_opts) if flag.startswith("-")}


def parsed(arguments: list[str]) -> dict[str, object]:
    command = get_command(app).get_command(None, "render")  # type: ignore[attr-defined]
    return dict(command.make_context("render", translate_foreign_flags(arguments)[1:]).params)


def test_the_tables_are_fresh() -> None:
    for tool in TABLES:
        assert all(mark in TEXT for mark in marks(tool))
    assert with_tables(TEXT) == TEXT, "docs/from-usdrecord-and-husk.md is stale; run `make docs`"


@pytest.mark.parametrize(("flag", "values"), UNDERSTOOD)
def test_what_is_understood_is_read(flag: str, values: str, capsys: pytest.CaptureFixture[str]) -> None:
    if flag in ("--help", "-h"):
        assert run(["render", flag]) == 0
        assert "Usage: primray render" in capsys.readouterr().out
        return
    without = parsed(["render", "s.usda"])
    found = parsed(["render", "s.usda", flag, *values.split()])
    assert found != without
    assert {name for name in found if found[name] != without[name]} <= {_parameter(flag)}


def _parameter(flag: str) -> str:
    command = get_command(app).get_command(None, "render")  # type: ignore[attr-defined]
    [name] = [param.name for param in command.params if flag in param.opts]
    return str(name)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("flag", REFUSED)
def test_what_is_refused_says_what_to_use(flag: str, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([command, "s.usda", flag, "x"]) == 2
    assert capsys.readouterr().err == f"error: foreign-flag: {flag}: {REFUSED[flag]}\n"
    if flag.startswith("--"):
        assert run([command, "s.usda", f"{flag}=x"]) == 2
        assert REFUSED[flag] in capsys.readouterr().err


@pytest.mark.parametrize(("flag", "values"), OTHERWISE)
def test_what_means_something_else_says_so(flag: str, values: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "s.usda", flag, *values.split()]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"{flag} " in told


@pytest.mark.parametrize("flag", DONE_ANYWAY)
def test_what_is_done_anyway_is_left_out(flag: str) -> None:
    values = ["1"] * DONE_ANYWAY[flag][0]
    assert translate_foreign_flags(["render", flag, *values, "s.usda"]) == ["render", "s.usda"]
    if values:
        assert translate_foreign_flags(["render", f"{flag}=1", "s.usda"]) == ["render", "s.usda"]


def test_the_tables_hold_all_flags_that_are_refused_or_done_anyway_and_no_other() -> None:
    listed = {flag for _, row in ROWS if isinstance(row, str) for flag in spellings(row)}
    assert listed == {*REFUSED, *DONE_ANYWAY}
    assert not REFUSED.keys() & DONE_ANYWAY.keys()
    for command in ("render", "estimate", "inspect"):
        assert not flags_of(command) & {*REFUSED, *DONE_ANYWAY}


def test_no_flag_is_listed_twice() -> None:
    for rows in TABLES.values():
        listed = [flag for row in rows for flag in spellings(row)]
        assert sorted(set(listed)) == sorted(listed)


def test_spellings_of_one_row_are_refused_alike() -> None:
    for _, row in ROWS:
        if isinstance(row, str):
            assert len({REFUSED.get(flag) for flag in spellings(row)}) == 1
