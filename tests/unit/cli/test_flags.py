"""Flags that commands share are the same everywhere, and every command that they mean something to has them."""

from __future__ import annotations

from typing import Annotated, Any, get_args, get_origin

import pytest
from typer.main import get_command
from typer.models import OptionInfo

from primray.cli import output_flags, render_flags, stage_flags
from primray.cli.app import app
from primray.cli.command_group import LazyCommand, loaded

COMMANDS = ("render", "estimate", "inspect", "doctor", "submit", "sheet", "merge", "view")
OPEN_A_STAGE = {"render", "estimate", "inspect", "doctor", "submit"}
RENDER = {"render", "estimate", "submit"}
LACKING = {
    ("submit", "--session-layer"): "a file of the user's machine",
    ("submit", "--rendering-color-space"): "no setting of the API",
    ("submit", "--res-scale"): "no setting of the API",
    ("submit", "--threads"): "the server decides",
    ("submit", "--max-memory"): "the server decides",
    ("submit", "--ray"): "the server decides",
    ("estimate", "--strict"): "makes no picture",
    ("estimate", "--fail-on"): "makes no picture",
    ("estimate", "--allow"): "makes no picture",
    ("estimate", "--time-limit"): "--pilot",
    ("estimate", "--max-memory"): "makes no picture",
    ("estimate", "--ray"): "makes no picture",
    ("render", "--pilot"): "makes the picture",
    ("submit", "--pilot"): "makes the picture",
}
# Several targets; one page, and several cameras and variants of one scene.
ITS_OWN = {("estimate", "--target-error"), *(("sheet", name) for name in ("--output", "--camera", "--variant"))}


def options(command: str) -> dict[str, Any]:
    group: Any = get_command(app)
    context = group.make_context("primray", [command], resilient_parsing=True)
    found = group.get_command(context, command)
    if isinstance(found, LazyCommand):
        found = loaded(command, found.target)
    return {each.opts[0]: each for each in found.params if each.opts[0].startswith("-")}


FOUND = {command: options(command) for command in COMMANDS}


def names_of(module: Any) -> list[str]:
    flags = [value for value in vars(module).values() if get_origin(value) is Annotated]
    found = [each for flag in flags for each in get_args(flag)[1:] if isinstance(each, OptionInfo)]
    return [str(each.default).partition("/")[0] for each in found]  # in an annotation, what comes first is the first name


STAGE, LIKE_RENDER, OUTPUT = (names_of(module) for module in (stage_flags, render_flags, output_flags))


@pytest.mark.parametrize("name", [*STAGE, *LIKE_RENDER, *OUTPUT])
def test_a_flag_is_the_same_in_every_command_that_has_it(name: str) -> None:
    having = {command: found[name] for command, found in FOUND.items() if name in found}
    assert having
    first = next(iter(having.values()))
    for command, option in having.items():
        assert (option.opts, option.secondary_opts) == (first.opts, first.secondary_opts), command
        assert option.nargs == first.nargs, command
        if (command, name) not in ITS_OWN:
            assert option.metavar == first.metavar, command
            assert option.type_descriptor.annotation == first.type_descriptor.annotation, command
            assert option.help == first.help, command


@pytest.mark.parametrize(("names", "commands"), [(STAGE, OPEN_A_STAGE), (LIKE_RENDER, RENDER)], ids=["stage", "render"])
def test_the_commands_that_should_have_a_flag_do(names: list[str], commands: set[str]) -> None:
    lacking = {(command, name) for name in names for command in commands if name not in FOUND[command]}
    assert lacking == {(command, name) for command, name in LACKING if name in names}


def test_every_flag_of_two_commands_is_in_a_module_of_flags() -> None:
    shared = {name for found in FOUND.values() for name in found if sum(name in other for other in FOUND.values()) > 1}
    assert shared - {"--help"} <= {*STAGE, *LIKE_RENDER, *OUTPUT}
