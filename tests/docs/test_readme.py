"""README.md is true: its generated table is fresh, its exit codes are the errors', its commands and flags exist."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from primray import errors
from primray.cli import run

from .supported import BEGIN, END, README, with_table

TEXT = README.read_text(encoding="utf-8")
ROOT = README.parent


def error_classes(base: type[errors.PrimrayError] = errors.PrimrayError) -> Iterator[type[errors.PrimrayError]]:
    """Of the renderer: the service's commands add one that carries its code and exit code in each case."""
    yield base
    for derived in base.__subclasses__():
        if derived.__module__.startswith("primray."):
            yield from error_classes(derived)


def test_the_table_is_fresh():
    assert BEGIN in TEXT
    assert END in TEXT
    assert with_table(TEXT) == TEXT, "README.md is stale; run `make docs`"


@pytest.mark.parametrize("error", list(error_classes()), ids=lambda error: error.__name__)
def test_each_error_has_a_documented_exit_code(error):
    documented = {int(code): meaning for code, meaning in re.findall(r"^\| (\d+) \| (.+) \|$", TEXT, re.MULTILINE)}
    assert error.exit_code in documented
    assert re.fullmatch(r"[a-z-]+", error.code)


def test_each_error_is_in_the_tree_at_the_top():
    assert errors.__doc__ is not None
    for error in error_classes():
        assert error.__name__ in errors.__doc__


def test_the_flags_it_names_exist(capsys: pytest.CaptureFixture[str]):
    run(["render", "--help"])
    known = set(re.findall(r"--?[a-zA-Z-]+", capsys.readouterr().out))
    for command in re.findall(r"^\s*primray render .*$", TEXT, re.MULTILINE):
        for flag in re.findall(r"(?<=\s)--?[a-zA-Z][a-zA-Z-]*", command):
            assert flag in known, f"{flag} in: {command}"


def test_the_commands_it_names_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"\bmake ([a-z-]+)", TEXT):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_files_it_links_exist():
    for link in re.findall(r"\]\(([^)#:]+)\)", TEXT):
        assert Path(ROOT, link).exists(), link
