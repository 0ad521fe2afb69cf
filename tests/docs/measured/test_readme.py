"""README.md and the pages of docs/ are true: figures are fresh, commands, flags and exit codes exist."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from tests.docs.measured import readme_figures

from primray import errors
from primray.cli import run

from .readme_figures import README, with_figures

TEXT = README.read_text(encoding="utf-8")
ROOT = README.parent
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def error_classes(base: type[errors.PrimrayError] = errors.PrimrayError) -> Iterator[type[errors.PrimrayError]]:
    """Of the renderer: the service's commands add one that carries its code and exit code in each case."""
    yield base
    for derived in base.__subclasses__():
        if derived.__module__.startswith("primray."):
            yield from error_classes(derived)


def commands(name: str) -> list[str]:
    """What the pages show of a command of primray, without what is said beside it."""
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    return [line.partition(" #")[0] for line in re.findall(rf"^ +primray {name} .*$", text, re.MULTILINE)]


def unknown_flags(command: str, known: set[str]) -> list[str]:
    own = command.partition(" -- ")[0]  # what follows is handed on to another command
    return [flag for flag in re.findall(r"(?<=\s)--?[a-zA-Z][a-zA-Z-]*", own) if flag not in known]


def test_pictures_come_first():
    assert "](docs/gallery/interior.jpg)" in TEXT[: TEXT.index("## ")]


def test_its_figures_are_fresh():
    assert readme_figures.BEGIN in TEXT
    assert readme_figures.END in TEXT
    assert with_figures(TEXT) == TEXT, "README.md is stale; run `make docs`"


@pytest.mark.parametrize("error", list(error_classes()), ids=lambda error: error.__name__)
def test_each_error_has_a_documented_exit_code(error):
    text = (ROOT / "docs" / "exit-codes.md").read_text(encoding="utf-8")
    documented = {int(code): meaning for code, meaning in re.findall(r"^\| (\d+) \| (.+) \|$", text, re.MULTILINE)}
    assert error.exit_code in documented
    assert re.fullmatch(r"[a-z-]+", error.code)


def test_each_error_is_in_the_tree_at_the_top():
    assert errors.__doc__ is not None
    for error in error_classes():
        assert error.__name__ in errors.__doc__


@pytest.mark.parametrize("name", ["render", "estimate", "merge", "compare", "inspect", "sheet"])
def test_the_flags_they_name_exist(name: str, capsys: pytest.CaptureFixture[str]):
    run([name, "--help"])
    known = set(re.findall(r"--?[a-zA-Z-]+", capsys.readouterr().out))
    assert commands(name)
    for command in commands(name):
        assert not unknown_flags(command, known), command


def test_flags_that_do_not_exist_are_seen():
    assert unknown_flags("primray render a.usda --spp 4 --nothing x -o a.exr", {"--spp", "-o"}) == ["--nothing"]


def test_the_commands_they_name_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for page in PAGES:
        for target in re.findall(r"(?:`|^ {4})make ([a-z-]+)", page.read_text(encoding="utf-8"), re.MULTILINE):
            assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"{page.name}: {target}"
