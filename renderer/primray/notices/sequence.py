"""Diagnostics of a sequence's frames: each is shown at the first frame that has it, and counted in the others."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

Row = Mapping[str, str]
Key = tuple[str, str, str]
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class SequenceNotices:
    """What has been shown of the frames so far. Rows are diagnostics in their JSON form."""

    def __init__(self) -> None:
        self._shown: set[tuple[str, ...]] = set()
        self._frames: Counter[Key] = Counter()
        self._total = 0

    def new(self, rows: Iterable[Row]) -> list[Row]:
        """Return the rows of another frame that no frame before had: of a prim, an attribute and a code, whatever the message
        says of the frame."""
        rows = list(rows)
        self._total += 1
        self._frames.update({(row["severity"], row["code"], row.get("kind", "")) for row in rows})
        new = [row for row in rows if _identity(row) not in self._shown]
        self._shown.update(map(_identity, rows))
        return new

    def lines(self) -> list[str]:
        """Say of each warning and error how many of the frames it concerns; nothing of a single frame."""
        if self._total < 2:
            return []
        return [
            f"{severity}: {code}{f' ({kind})' if kind else ''}: in {count:,} of {self._total:,} frames"
            for (severity, code, kind), count in sorted(self._frames.items())
            if severity != "info"
        ]


def _identity(row: Row) -> tuple[str, ...]:
    place = row["prim_path"], row.get("attribute", "")
    if any(place):
        return row["severity"], row["code"], *place
    # What was chosen for a frame differs by its numbers: a turntable's degrees.
    message = _NUMBER.sub("#", row["message"]) if row["severity"] == "info" else row["message"]
    return row["severity"], row["code"], message
