"""The commands that README.md and docs print are run as they are printed, at a sixteenth of the resolution and without waiting
for time limits to pass; those that need a server, a cluster, a browser or a viewer are read to their end."""

from __future__ import annotations

from contextlib import ExitStack
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import pytest
from typer.main import get_command

from primray.cli import run, shots
from primray.cli.app import app

from .printed import ROOT, pages, printed_commands
from .shot import write_shot

PAGES = {str(page.relative_to(ROOT)): list(printed_commands(page)) for page in pages()}
# Those that end by themselves and need no server, cluster, browser or viewer.
RUN_HERE = ("render", "compare", "inspect", "estimate", "merge", "sheet", "thumbnail", "doctor")
ELSEWHERE = ("--ray", "tev:", "scenes/gallery", "scenes/analytic", "$")
SMALLER = 1 / 16
LIMIT = "0.2"  # seconds
SEVERAL = {"--stereo", "--turntable"}  # pictures are named after the one that is given
# What a page's commands read that no command of the page writes.
MADE_ELSEWHERE = {
    "a.exr": "render shot.usda -o a.exr",
    "b.exr": "render shot.usda -o b.exr --seed 1",
    "before.exr": "render shot.usda -o before.exr",
    "after.exr": "render shot.usda -o after.exr --seed 1",
    "before.png": "render shot.usda -o before.png",
    "after.png": "render shot.usda -o after.png --seed 1",
    "before": "render shot.usda --frames 1:2 -o before/beauty.####.exr --make-output-path",
    "after": "render shot.usda --frames 1:2 -o after/beauty.####.exr --make-output-path --seed 1",
    "before/beauty.####.exr": "render shot.usda --frames 1:2 -o before/beauty.####.exr --make-output-path",
    "after/beauty.####.exr": "render shot.usda --frames 1:2 -o after/beauty.####.exr --make-output-path --seed 1",
    "after/beauty.%04d.exr": "render shot.usda --frames 1:2 -o after/beauty.%04d.exr --make-output-path --seed 1",
    "b.prc": "render shot.usda --sample-range 512:1024 --checkpoint b.prc -o b.exr",
}


def runs_here(command: list[str]) -> bool:
    if find_spec("pyoidn") is None and any("denoise" in word for word in command):
        return False
    if "--fps" in command and shots._program() is None:
        return False
    return command[0] in RUN_HERE and not any(word.startswith(ELSEWHERE) for word in command)


def without_waiting(command: list[str]) -> list[str]:
    return [LIMIT if flag == "--time-limit" else word for flag, word in zip(["", *command], command, strict=False)]


def smaller(command: list[str]) -> list[str]:
    """The command at a sixteenth of its resolution, unless it says which."""
    if command[0] not in ("render", "estimate", "doctor") or {"--res-scale", "-S", "--debug-pixel"} & set(command):
        return command
    return [command[0], "--res-scale", str(100 * SMALLER), *command[1:]]


HERE = {page: commands for page, found in PAGES.items() if (commands := [c for c in found if runs_here(c)])}
OTHERS = {" ".join(c): c for found in PAGES.values() for c in found if not runs_here(c)}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_shot(tmp_path)
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_pages_print_commands() -> None:
    assert sum(map(len, HERE.values())) > 40
    assert len(OTHERS) > 20


@pytest.mark.parametrize("page", HERE)
def test_the_commands_of_a_page_end_well_one_after_the_other(
    page: str, folder: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    for command in HERE[page]:
        if command[0] in ("compare", "merge"):
            for file in command[1:3]:
                assert Path(file).exists() or run(smaller(MADE_ELSEWHERE[file].split())) == 0
        code = run(smaller(without_waiting(command)))
        said = capfdbinary.readouterr()
        assert code == 0, (command, (said.out + said.err).decode(errors="replace"))
        for flag, file in pairwise(command):
            if flag == "-o" and not SEVERAL & set(command) and not file.endswith("-") and not set("#%$") & set(file):
                assert Path(file).exists(), command


@pytest.mark.parametrize("line", OTHERS)
def test_other_printed_commands_are_read_to_their_end(line: str) -> None:
    words = ["1" if word.startswith("$") else word for word in OTHERS[line]]
    command, name, rest = get_command(app), "primray", words
    with ExitStack() as contexts:
        context = None
        while hasattr(command, "resolve_command"):
            context = contexts.enter_context(command.make_context(name, rest, parent=context))
            name, command, rest = command.resolve_command(context, [*context._protected_args, *context.args])
        contexts.enter_context(command.make_context(name, rest, parent=context))
