"""Error messages for numeric options that quote the value as typed and name the expected form, instead of Typer's own."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import typer

_WANTED = re.compile(r"valid (integer|number|float)")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_WITH_UNIT = re.compile(rf"({_NUMBER})\s*([A-Za-z%]+)")
_FACTORS = {"%": 0.01, "k": 1e3, "K": 1e3, "M": 1e6}  # for the suggested value; other units have factor 1


def naming_values(command: Any) -> Any:
    """Return the command, or the group with its commands, with options whose errors quote the refused value."""
    for inner in getattr(command, "commands", {}).values():
        naming_values(inner)
    for param in getattr(command, "params", ()):
        if not isinstance(param.process_value, partial):
            param.process_value = partial(_process, param, param.process_value)
    return command


def _process(param: Any, process: Callable[[Any, Any], Any], ctx: Any, value: Any) -> Any:
    try:
        return process(ctx, value)
    except typer.BadParameter as error:
        typed = [value] if isinstance(value, str) else [*value] if isinstance(value, list | tuple) else []
        if typed and all(isinstance(word, str) for word in typed):
            error.message = _sentence(error.message, typed, param)
        raise


def _sentence(message: str, typed: list[str], param: Any) -> str:
    wanted = _WANTED.search(message)
    if wanted is None:
        shown = " ".join(typed)
        return message if shown in message else f"{shown!r}: {message}"
    is_whole = wanted[1] == "integer"
    bad = next((word for word in typed if not _is_number(word, is_whole)), typed[0])
    form = "a whole number" if is_whole else "a number"
    sentence = f"{bad!r} is not {form}"
    if len(typed) > 1 and param.nargs > 1:
        return f"{sentence}; expected {param.nargs} numbers: {param.metavar}"
    with_unit = _WITH_UNIT.fullmatch(bad)
    if with_unit is not None and _is_number(with_unit[1], is_whole):
        meant = float(with_unit[1]) * _FACTORS.get(with_unit[2], 1)
        return f"{sentence}: write it without a unit, such as {meant:.12g}"
    return f"{sentence}, such as {64 if is_whole else 0.5}"


def _is_number(text: str, is_whole: bool) -> bool:
    try:
        int(text) if is_whole else float(text)
    except ValueError:
        return False
    return True
