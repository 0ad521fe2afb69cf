"""Diagnostics of a sequence's frames: each is shown at the first frame that has it, and counted in the others."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping

Row = Mapping[str, str]
Key = tuple[str, str, str]
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class SequenceNotices:
    """What has been shown of the frames so far. Rows are diagnostics in their JSON form; a frame may have several renders, of
    products or of two eyes."""

    def __init__(self) -> None:
        self._shown: set[tuple[str, ...]] = set()
        self._frames: defaultdict[Key, set[Hashable]] = defaultdict(set)
        self._all: set[Hashable] = set()

    def new(self, rows: Iterable[Row], frame: Hashable) -> list[Row]:
        """Return the rows of another render, which is one of `frame`, that no render before had: of a prim, an attribute and a
        code, whatever the message says of the frame."""
        rows = list(rows)
        self._all.add(frame)
        for row in rows:
            self._frames[row["severity"], row["code"], row.get("kind", "")].add(frame)
        new = [row for row in rows if _identity(row) not in self._shown]
        self._shown.update(map(_identity, rows))
        return new

    def lines(self) -> list[str]:
        """Say of each warning and error how many of the frames it concerns; nothing of a single frame."""
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
    # What was chosen for a frame differs by its numbers: a turntable's degrees.
    message = _NUMBER.sub("#", row["message"]) if row["severity"] == "info" else row["message"]
    return row["severity"], row["code"], message
