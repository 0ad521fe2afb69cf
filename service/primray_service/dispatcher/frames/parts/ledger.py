"""Ledger of a frame's samples: which are merged, which are done and wait for a merge, which are in progress. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from primray.distributed.planner import AssignedRanges

from ....jobs import Part, PartState


class Ledger:
    """Parts are disjoint, and follow `merged`; gaps between them are to be handed out again."""

    def __init__(self, merged: int, parts: Iterable[Part]) -> None:
        self.merged = merged
        self._parts: dict[int, Part] = {}
        for part in sorted(parts, key=lambda part: part.first):
            if part.first >= self.given:  # a server died before it wrote the row of a part that it had shortened
                self.put(part)

    @property
    def given(self) -> int:
        """Return the end of the last range that was handed out."""
        return max((part.end for part in self._parts.values()), default=self.merged)

    @property
    def parts(self) -> list[Part]:
        return [self._parts[first] for first in sorted(self._parts)]

    @property
    def board(self) -> AssignedRanges:
        """Return the intervals that are merged or belong to a part."""
        board = AssignedRanges()
        for span in [(0, self.merged), *((part.first, part.end) for part in self._parts.values())]:
            board.take(span)
        return board

    def put(self, part: Part) -> None:
        self._parts[part.first] = part

    def ends(self, part: Part) -> bool:
        """Record that a part is no longer in progress: it is done, or waits. False if it was shortened meanwhile, and its
        samples are of no use."""
        cut = self.is_cut(part)
        self.put(_anew(part, self._parts[part.first].end) if cut else part)
        return not cut

    def is_cut(self, part: Part) -> bool:
        """Return whether the part was shortened after it had been handed out."""
        return self._parts[part.first].end != part.end

    def cut(self, goal: int) -> list[Part]:
        """Shorten parts at that number of samples, and return them as they were; they end there now, and have no samples. One
        in progress stays so until it `ends`."""
        across = [self._parts[first] for first, _ in self.board.across(goal) if first >= self.merged]
        for part in across:
            self.put(replace(part, end=goal) if part.state is PartState.RUNNING else _anew(part, goal))
        return across

    def waiting(self) -> Part | None:
        """Return the first part that was handed out and came back."""
        return next((part for part in self.parts if part.state is PartState.WAITING), None)

    def done_from(self, goal: int) -> int:
        """Return the number of parts from that sample on that are done."""
        return sum(part.first >= goal and part.state is PartState.DONE for part in self._parts.values())

    def to_merge(self, goal: int) -> list[Part]:
        """Return the done parts that follow the merged samples without a gap, up to that number."""
        found: list[Part] = []
        end = self.merged
        for part in self.parts:
            if part.first != end or part.end > goal or part.state is not PartState.DONE:
                break
            found.append(part)
            end = part.end
        return found

    def merge(self, end: int) -> list[Part]:
        """Record that the first `end` samples are merged, and return the parts that held them."""
        gone = [part for part in self.parts if part.end <= end]
        for part in gone:
            del self._parts[part.first]
        self.merged = end
        return gone

    def taken(self) -> int:
        """Return the number of samples that are merged or in done parts."""
        return self.merged + sum(part.samples for part in self._parts.values() if part.state is PartState.DONE)


def waits_again(part: Part) -> Part:
    return replace(part, state=PartState.WAITING, claim="")


def _anew(part: Part, end: int) -> Part:
    return Part(part.job_id, part.frame, part.first, end)
