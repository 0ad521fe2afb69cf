"""A guard of all commands: no output takes the place of a file that the command reads, and no two outputs are one file.

Files that the command line names are compared first, those that a stage brings when they are opened (read_files.py).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from inspect import signature
from typing import Any

from ..errors import SettingsError
from ..read_files import REPLACED, watching_files

# Parameters of commands by what they are; a checkpoint may be the one that is resumed.
READ = (
    *("scene", "stage", "asset", "session_layer", "dome", "background"),
    *("picture", "reference", "a", "b", "parts"),
    *("model", "pattern", "meters", "key", "attestation"),
)
WRITTEN = ("output", "outputs", "report", "layer", "overlay", "difference", "lock", "profile", "checkpoint")


def keeping_inputs(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command, which first raises SettingsError where an output is a file that it reads, or another output."""

    @wraps(command)
    def run(**given: Any) -> None:
        run_keeping_inputs(command, given)

    vars(run)["__signature__"] = signature(command, eval_str=True)
    return run


def run_keeping_inputs(command: Callable[..., None], given: Mapping[str, Any]) -> None:
    """Run a command as `keeping_inputs` does."""
    check_outputs(given)
    with watching_files():
        command(**given)


def check_outputs(given: Mapping[str, Any]) -> None:
    """Raise SettingsError `output-folder` where a written file is a read one, `output-name` where it is another written one."""
    read = {os.path.realpath(path) for _, path in _files(given, READ)}
    written: dict[str, str] = {}
    for name, path in _files(given, WRITTEN):
        target = os.path.realpath(path)
        if os.path.exists(target) and not os.path.isfile(target):
            continue  # /dev/null holds nothing that could be lost
        if target in read:
            raise SettingsError(REPLACED, where=path, code="output-folder")
        if written.setdefault(target, name) != name:
            raise SettingsError("the same output is named twice", where=path, code="output-name")


def _files(given: Mapping[str, Any], names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    for name in names:
        value = given.get(name)
        for path in value if isinstance(value, list | tuple) else [value]:
            if isinstance(path, str | os.PathLike) and os.fspath(path):
                yield name, str(path)
