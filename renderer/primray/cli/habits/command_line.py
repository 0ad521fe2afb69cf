"""Conversion of command lines in the style of usdrecord and husk to primray's own.

Only flags that primray does not have, sizes like 320x200, and husk's `--verbose LEVEL` are converted; the rest is unchanged.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from ...errors import SettingsError
from .foreign_flags import DONE_ANYWAY, REFUSED

COMMANDS = ("render", "estimate", "inspect", "submit")  # commands with a counterpart in usdrecord or husk

_LEVEL = re.compile(r"[aAcCeEpPtT]*(\d)[aAcCeEpPtT]*")  # husk's level: a digit among letters for the line format
SIZES = ("--res", "--resolution", "-r")
_SIZE = re.compile(r"(\d+)[x,X\u00d7](\d+)")
_STARTS_NUMBER = re.compile(r"-?\d")
QUIET_LEVEL = 2  # husk's default; higher levels are primray's --verbose


def without_habits(arguments: Sequence[str]) -> list[str]:
    """Return the command line in primray's own style. SettingsError, with advice, for a flag that is refused."""
    arguments = [*_with_sizes_apart(iter(arguments))]
    if not arguments or arguments[0] not in COMMANDS:
        return arguments
    return [arguments[0], *_words(iter(arguments[1:]))]


def _with_sizes_apart(words: Iterator[str]) -> Iterator[str]:
    """Yield the words, splitting sizes like 320x200 into two; SettingsError for a size of one number."""
    for word in words:
        flag, joined, size = word.partition("=") if word.startswith("--") else (word, "", "")
        if word == "--" or flag not in SIZES:
            yield word
            if word == "--":
                yield from words
            continue
        first = size if joined else next(words, None)
        yield flag
        both = None if first is None else _SIZE.fullmatch(first)
        if both is not None:
            yield from both.groups()
            continue
        second = next(words, None)
        if first is not None and first[:1].isdigit() and not _STARTS_NUMBER.match(second or ""):
            sentence = f"expected width and height in pixels, such as 320 200 or 320x200 (0: from the camera), not {first}"
            raise SettingsError(sentence, where=flag, code="resolution")
        yield from (word for word in (first, second) if word is not None)


def _words(words: Iterator[str]) -> Iterator[str]:
    """Yield the words without ignored flags. `words` is consumed lazily, since a flag may take its value from the next word."""
    pending: list[str] = []
    while (word := pending.pop() if pending else next(words, None)) is not None:
        if word == "--":
            yield word
            yield from words
            return
        flag, joined, value = word.partition("=") if word.startswith("--") else (word, "", "")
        _refuse(flag)
        if flag in DONE_ANYWAY:
            if DONE_ANYWAY[flag][0] and not joined:
                next(words, None)
        elif flag == "-r":
            yield word
            pending += _size(words)
        elif flag in ("--verbose", "-V"):
            following = value if joined else next(words, None)
            level = _LEVEL.fullmatch(following or "")
            if level is None or int(level[1]) > QUIET_LEVEL:
                yield flag
            if level is None and following is not None:
                if joined:
                    raise _no_level(value)
                pending.append(following)
        elif word.startswith("-V") and _LEVEL.fullmatch(word[2:]):
            pending += ["--verbose=" + word[2:]]
        else:
            yield word


def _refuse(flag: str) -> None:
    known = flag if flag in REFUSED else flag[:2] if flag[:1] == "-" != flag[1:2] else ""  # -RKarma is -R Karma
    if known in REFUSED:
        raise SettingsError(f"{known}: {REFUSED[known]}", code="foreign-flag")


def _size(words: Iterator[str]) -> list[str]:
    """Return the word after -r; SettingsError for usdrecord's -r, which names a renderer."""
    word = next(words, None)
    if word is not None and word[:1].isalpha():
        raise SettingsError(f"-r means --res W H; for usdrecord's --renderer: {REFUSED['--renderer']}", code="foreign-flag")
    return [] if word is None else [word]


def _no_level(text: str) -> SettingsError:
    return SettingsError(f"--verbose expects a level such as 3, not {text!r}", code="verbose")
