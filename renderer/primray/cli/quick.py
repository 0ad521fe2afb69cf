"""Fast parser for plain `primray render` command lines, because Typer takes longer to import than NumPy.

It is not a second command line: help, errors and anything unusual are left to Typer, which then parses the whole line.
`test_quick.py` checks the table against Typer's options.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import Any, get_args

from .flags import flags_of


def _number(text: str) -> float:
    if not re.fullmatch(r"\d{1,15}(\.\d{1,15})?(e-?\d{1,2})?", text):
        raise ValueError(text)
    return float(text)


def _whole(text: str) -> int:
    if not re.fullmatch(r"\d{1,15}", text):
        raise ValueError(text)
    return int(text)


_READERS: dict[Any, Callable[[str], Any]] = {int: _whole, float: _number, str: str}

# Parameters of `render` with the forms of their values and their flags.
TABLE: dict[str, tuple[Any, tuple[str, ...]]] = {
    name: (flag.form, tuple(word for names in flag.names for word in names.split("/")))
    for name, flag in flags_of().items()
    if flag.names and "render" in flag.commands
}
_BY_FLAG = {flag: (name, form) for name, (form, flags) in TABLE.items() for flag in flags}


def render_arguments(line: Sequence[str]) -> dict[str, Any] | None:
    """Return the arguments of `render`, or None if the line is for another command or not plain."""
    if not line or line[0] != "render":
        return None
    try:
        return _read(iter(line[1:]))
    except (ValueError, StopIteration):
        return None


def _read(words: Iterator[str]) -> dict[str, Any]:
    places: list[str] = []
    given: dict[str, Any] = {}
    for word in words:
        if not word.startswith("-"):
            places.append(word)
            continue
        flag, joined, text = word.partition("=") if word.startswith("--") else (word, "", "")
        name, form = _BY_FLAG.get(flag, ("", bool))
        items = get_args(form) if form != list[str] else ()
        if not name or (joined and (form is bool or items)):
            raise ValueError(word)
        values = iter([text]) if joined else words
        if form is bool:
            given[name] = not flag.startswith("--no-") or flag == TABLE[name][1][0]
        elif form == list[str]:
            given.setdefault(name, []).append(_value(values))
        elif items:
            given[name] = tuple([_read_value(item, next(values)) for item in items])
        else:
            given[name] = _read_value(form, _value(values))
    if not 1 <= len(places) <= 2 or not all(places):
        raise ValueError("the scene, and perhaps the output")
    return given | dict(zip(("scene", "output"), places, strict=False))


def _read_value(form: Any, text: str) -> Any:
    if issubclass(form, Enum):
        return form(text)
    return _READERS[form](text)


def _value(values: Iterator[str]) -> str:
    text = next(values)
    if text.startswith("-") or not text:
        raise ValueError(text)
    return text
