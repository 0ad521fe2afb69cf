"""Flags that commands share are the same everywhere, and every command that they mean something to has them."""

from __future__ import annotations

from typing import Any

import pytest
from typer.main import get_command

from primray.cli.app import LazyCommand, app, loaded
from primray.cli.flags import flags_of

COMMANDS = ("render", "estimate", "explain", "inspect", "doctor", "submit", "sheet", "thumbnail", "merge", "view", "lidar")
OPEN_A_STAGE = {"render", "estimate", "explain", "inspect", "doctor", "submit"}
RENDER = {"render", "estimate", "explain", "submit"}
LACKING = {
    ("submit", "--session-layer"): "a file of the user's machine",
    ("submit", "--rendering-color-space"): "no setting of the API",
    ("submit", "--res-scale"): "no setting of the API",
    ("submit", "--threads"): "the server decides",
    ("estimate", "--strict"): "makes no picture",
    ("estimate", "--fail-on"): "makes no picture",
    ("estimate", "--allow"): "makes no picture",
    ("explain", "--pilot"): "makes the samples",
    ("explain", "--region"): "has a pixel",
    ("explain", "--adaptive"): "one pixel's samples",
    ("explain", "--error-metric"): "one pixel's samples",
    ("explain", "--strict"): "makes no picture",
    ("explain", "--fail-on"): "makes no picture",
    ("explain", "--allow"): "makes no picture",
    ("render", "--pilot"): "makes the picture",
    ("submit", "--pilot"): "makes the picture",
}
# Several targets; one page, and several cameras and variants of one scene; files of points.
ITS_OWN = {
    ("estimate", "--target-error"),
    *(("sheet", name) for name in ("--output", "--camera", "--variant", "--ray")),
    ("lidar", "--output"),
    ("lidar", "--report"),
    ("relight", "--mix"),
    ("explain", "--report"),
}


def options(command: str) -> dict[str, Any]:
    group: Any = get_command(app)
    context = group.make_context("primray", [command], resilient_parsing=True)
    found = group.get_command(context, command)
    if isinstance(found, LazyCommand):
        found = loaded(command, found.target)
    return {each.opts[0]: each for each in found.params if each.opts[0].startswith("-")}


FOUND = {command: options(command) for command in COMMANDS}


FLAGS = {flag.names[0].partition("/")[0]: flag for flag in flags_of().values() if flag.names}
STAGE = [name for name, flag in FLAGS.items() if "inspect" in flag.commands]
LIKE_RENDER = [name for name, flag in FLAGS.items() if "estimate" in flag.commands and name not in STAGE]


@pytest.mark.parametrize("name", FLAGS)
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
    assert shared - {"--help"} <= set(FLAGS)
