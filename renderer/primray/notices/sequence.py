"""Diagnostics of a frame sequence: each is shown at the first frame that has it, and counted in the others."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping

Row = Mapping[str, str]
Key = tuple[str, str, str]
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class SequenceNotices:
    """Diagnostics shown so far in a sequence.

    Rows are diagnostics in their JSON form; a frame may have several renders, for products or for two eyes.
    """

    def __init__(self) -> None:
        self._shown: set[tuple[str, ...]] = set()
        self._frames: defaultdict[Key, set[Hashable]] = defaultdict(set)
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
