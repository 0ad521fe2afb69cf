"""A guard of all commands: no output takes the place of a file that the command reads, and no two outputs are one file."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from inspect import signature
from typing import Any

from ..errors import SettingsError

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
        check_outputs(given)
        command(**given)

    vars(run)["__signature__"] = signature(command, eval_str=True)
    return run


def check_outputs(given: Mapping[str, Any]) -> None:
    """Raise SettingsError `output-folder` where a written file is a read one, `output-name` where it is another written one."""
    read = {os.path.realpath(path) for _, path in _files(given, READ)}
    written: dict[str, str] = {}
    for name, path in _files(given, WRITTEN):
        target = os.path.realpath(path)
        if os.path.exists(target) and not os.path.isfile(target):
            continue  # /dev/null holds nothing that could be lost
        if target in read:
            sentence = "the output would overwrite a file that the command reads: give it another name"
            raise SettingsError(sentence, where=path, code="output-folder")
        if written.setdefault(target, name) != name:
            raise SettingsError("the same output is named twice", where=path, code="output-name")


def _files(given: Mapping[str, Any], names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    for name in names:
        value = given.get(name)
        for path in value if isinstance(value, list | tuple) else [value]:
            if isinstance(path, str | os.PathLike) and os.fspath(path):
                yield name, str(path)
