"""Reads plain `primray render` command lines by itself, since Typer and what it needs take longer to import than NumPy.

Not a second command line: flags outside the table, help, anything that is wrong or merely unusual are Typer's, which then
reads the whole line; `test_quick.py` holds the table against what Typer was told.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

FLAG, LIST, PAIR = "flag", "list", "pair"  # True; values that add up; two whole numbers
Kind = Callable[[str], Any] | str


def _number(text: str) -> float:
    if not re.fullmatch(r"\d{1,15}(\.\d{1,15})?(e-?\d{1,2})?", text):
        raise ValueError(text)
    return float(text)


def _whole(text: str) -> int:
    if not re.fullmatch(r"\d{1,15}", text):
        raise ValueError(text)
    return int(text)


# Flags of one parameter, which is named first.
TABLE: dict[str, tuple[Kind, tuple[str, ...]]] = {
    "outputs": (LIST, ("--output", "-o")),
    "camera": (str, ("--camera", "-c", "-cam")),
    "res": (PAIR, ("--res", "-r")),
    "image_width": (_whole, ("--imageWidth", "-w")),
    "frames": (str, ("--frames", "-f")),
    "spp": (_whole, ("--spp", "--pixel-samples", "-p")),
    "target_error": (_number, ("--target-error",)),
    "time_limit": (_number, ("--time-limit",)),
    "max_depth": (_whole, ("--max-depth",)),
    "threads": (_whole, ("--threads", "-j")),
    "seed": (_whole, ("--seed",)),
    "aovs": (LIST, ("--aov",)),
    "report": (str, ("--report",)),
    "checkpoint": (str, ("--checkpoint",)),
    "json": (FLAG, ("--json",)),
    "strict": (FLAG, ("--strict",)),
    "no_default_light": (FLAG, ("--no-default-light",)),
    "verbose": (FLAG, ("--verbose", "-V")),
}
_BY_FLAG = {flag: (name, kind) for name, (kind, flags) in TABLE.items() for flag in flags}


def render_arguments(line: Sequence[str]) -> dict[str, Any] | None:
    """What `render` is to be called with; None if the line is for another command or not as plain as that."""
    if not line or line[0] != "render":
        return None
    try:
        return _read(iter(line[1:]))
    except (ValueError, StopIteration):
        return None


def _read(words: Any) -> dict[str, Any]:
    places: list[str] = []
    given: dict[str, Any] = {}
    for word in words:
        if not word.startswith("-"):
            places.append(word)
            continue
        name, kind = _BY_FLAG.get(word, ("", FLAG))
        if not name:
            raise ValueError(word)
        if kind == FLAG:
            given[name] = True
        elif kind == LIST:
            given.setdefault(name, []).append(_value(words))
        elif kind == PAIR:
            given[name] = (_whole(next(words)), _whole(next(words)))
        elif callable(kind):
            given[name] = kind(_value(words))
    if not 1 <= len(places) <= 2 or not all(places):
        raise ValueError("the scene, and perhaps the output")
    return given | dict(zip(("scene", "output"), places, strict=False))


def _value(words: Any) -> str:
    text: str = next(words)
    if text.startswith("-") or not text:
        raise ValueError(text)
    return text
