"""Diagnostics as text: grouped by severity, kind, code and attribute, worst first, with the first few prims of each group.

A message that many prims share is printed once; of messages that differ from prim to prim, the first few. JSON has them all. In
a frame sequence, each is shown at the first frame that has it, and counted in the others.
"""

from __future__ import annotations

import re
import sys
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Mapping

from ..diagnostic_codes import Kind

_ORDER = ("error", "warning", "info")
_KINDS = tuple(kind.value for kind in Kind)
_PRIMS_SHOWN = 3
_MESSAGES_SHOWN = 3

Row = Mapping[str, str]
Key = tuple[str, str, str, str]  # severity, kind, code, attribute
CountKey = tuple[str, str, str]
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def print_diagnostics(diagnostics: Iterable[Row], *, verbose: bool) -> None:
    """Print diagnostics to stderr; stdout is reserved for requested output."""
    for line in diagnostics_lines(diagnostics, verbose=verbose):
        print(line, file=sys.stderr)


def diagnostics_lines(diagnostics: Iterable[Row], *, verbose: bool = False) -> list[str]:
    """Return lines of text for diagnostics in their JSON form, with all messages and prims if `verbose`."""
    groups: dict[Key, dict[str, list[Row]]] = {}
    for row in diagnostics:
        key = (row["severity"], row.get("kind", ""), row["code"], row.get("attribute", ""))
        groups.setdefault(key, {}).setdefault(row["message"], []).append(row)
    lines = []
    for key, messages in sorted(groups.items(), key=lambda item: _rank(item[0])):
        lines += _group(key, messages, verbose)
    return lines


def fidelity_text(diagnostics: Iterable[Row]) -> str:
    """Return one line counting the warnings and errors of each kind that changes the picture."""
    counts = Counter(row["kind"] for row in diagnostics if row["severity"] != "info")
    told = [f"{counts[kind.value]:,} {kind.value}" for kind in Kind if kind.changes_picture and counts[kind.value]]
    return ", ".join(told) or "as authored"


def _rank(key: Key) -> tuple[int, int, str, str]:
    severity, kind, code, attribute = key
    return _ORDER.index(severity), _KINDS.index(kind) if kind in _KINDS else len(_KINDS), code, attribute


def _group(key: Key, messages: dict[str, list[Row]], verbose: bool) -> list[str]:
    severity, kind, code, attribute = key
    head = f"{severity}: {code}{f' ({kind})' if kind and kind != code else ''}: "
    shown = list(messages.items()) if verbose else list(messages.items())[:_MESSAGES_SHOWN]
    lines = []
    for message, rows in shown:
        times = f" ({len(rows):,} times)" if len(rows) > 1 else ""
        lines.append(f"{head}{_sentence(attribute, message)}{times}")
        lines += _prims(rows, verbose)
    left = [row for rows in list(messages.values())[len(shown) :] for row in rows]
    if left:
        lines.append(f"{head}{f'{attribute}: ' if attribute else ''}and {len(left):,} more of this kind")
        lines += _prims(left, verbose)
    return lines


def _sentence(attribute: str, message: str) -> str:
    """Return the message prefixed with its attribute, merged if it begins with the attribute's name.

    "roughness = 3 is .." becomes "inputs:roughness = 3 is ..".
    """
    if message.startswith(attribute):  # always true for ""
        return message
    name = attribute.rpartition("inputs:")[2]
    return f"{attribute}{message.removeprefix(name)}" if message.startswith(f"{name} ") else f"{attribute}: {message}"


def _prims(rows: list[Row], verbose: bool) -> list[str]:
    paths = list(dict.fromkeys(row["prim_path"] for row in rows if row["prim_path"]))
    shown = paths if verbose else paths[:_PRIMS_SHOWN]
    more = f" and {len(paths) - len(shown):,} more" if len(paths) > len(shown) else ""
    return [f"    {', '.join(shown)}{more}"] if shown else []


class SequenceNotices:
    """Diagnostics shown so far in a sequence.

    Rows are diagnostics in their JSON form; a frame may have several renders, for products or for two eyes.
    """

    def __init__(self) -> None:
        self._shown: set[tuple[str, ...]] = set()
        self._frames: defaultdict[CountKey, set[Hashable]] = defaultdict(set)
        self._all: set[Hashable] = set()

    def new(self, rows: Iterable[Row], frame: Hashable) -> list[Row]:
        """Return the rows of another render of `frame` that no earlier render had.

        Rows are the same if prim, attribute and code are, whatever the message says.
        """
        rows = list(rows)
        self._all.add(frame)
        for row in rows:
            self._frames[row["severity"], row["code"], row.get("kind", "")].add(frame)
        new = [row for row in rows if _identity(row) not in self._shown]
        self._shown.update(map(_identity, rows))
        return new

    def lines(self) -> list[str]:
        """Return a line for each warning and error with the number of frames concerned; nothing for a single frame."""
        if len(self._all) < 2:
            return []
        return [
            f"{severity}: {code}{f' ({kind})' if kind else ''}: in {len(frames):,} of {len(self._all):,} frames"
            for (severity, code, kind), frames in sorted(self._frames.items())
            if severity != "info"
        ]


def _identity(row: Row) -> tuple[str, ...]:
    place = row["prim_path"], row.get("attribute", "")
    if any(place):
        return row["severity"], row["code"], *place
    # Choices made per frame differ only in their numbers, such as a turntable's degrees.
    message = _NUMBER.sub("#", row["message"]) if row["severity"] == "info" else row["message"]
    return row["severity"], row["code"], message
