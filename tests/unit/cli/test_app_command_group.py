"""Commands of other packages: found by their entry points, imported when they are used."""

from __future__ import annotations

import importlib.metadata
import sys
from pathlib import Path
from typing import Any

import pytest

from primray.cli import app, run

TABLE = """
COMMANDS = {
    "greet": ("their_greeting:greet", "Say hello."),
    "many": ("their_greeting:many", "Several of them."),
    "render": ("their_greeting:greet", "Not this one: the name is taken."),
    "broken": ("their_greeting:none", "There is none."),
}
"""
MODULE = '''
import typer

many = typer.Typer()

def greet(name: str, loud: bool = False) -> None:
    """Say hello to somebody."""
    if name == "nobody":
        raise RuntimeError("nobody is there")
    print(f"hello {name}{'!' if loud else ''}")

@many.command()
def one() -> None:
    print("one")

@many.command()
def two() -> None:
    print("two")
'''


@pytest.fixture(autouse=True)
def _another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "their_table.py").write_text(TABLE)
    (tmp_path / "their_greeting.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    entry = importlib.metadata.EntryPoint("theirs", "their_table:COMMANDS", app.GROUP)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **asked: [entry] if asked == {"group": app.GROUP} else [])
    for name in ("their_table", "their_greeting"):
        monkeypatch.delitem(sys.modules, name, raising=False)


def test_they_are_listed_after_our_own_without_being_imported(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    listed = [line.split()[0] for line in lines[lines.index("Commands:") + 1 :] if line.strip()]
    assert listed[0] == "render"
    assert listed[-3:] == ["greet", "many", "broken"]
    assert any(line.split() == ["greet", "Say", "hello."] for line in lines)
    assert "their_greeting" not in sys.modules


def test_they_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["greet", "you", "--loud"]) == 0
    assert run(["many", "two"]) == 0
    assert capsys.readouterr().out == "hello you!\ntwo\n"
    assert run(["greet", "--help"]) == 0
    assert "primray greet" in capsys.readouterr().out


def test_they_end_as_ours_do(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["greet"]) == 2
    assert run(["greet", "nobody"]) == 1
    said = capsys.readouterr().err
    assert "error: internal: RuntimeError: nobody is there" in said
    assert "Traceback" not in said
    assert run(["broken"]) == 1


def test_ours_come_first_and_need_no_look_at_theirs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def looked(**asked: Any) -> list[Any]:
        raise AssertionError("nobody asked for them")

    monkeypatch.setattr(importlib.metadata, "entry_points", looked)
    assert run(["render", "--help"]) == 0
    assert "Render a USD stage" in capsys.readouterr().out
    assert app.app.info.cls is app.CommandGroup


def test_a_slip_of_the_finger(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["gret"]) == 2
    assert "'greet'" in capsys.readouterr().err
