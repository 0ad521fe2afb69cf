"""Which samples of a frame are merged, which are taken and wait for that, which are being taken. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from primray.parts.board import Board

from ....jobs import Part, PartState


class Ledger:
    """Parts are disjoint, and behind `merged`; there may be gaps between them, which are to be given out anew."""

    def __init__(self, merged: int, parts: Iterable[Part]) -> None:
        self.merged = merged
        self._parts: dict[int, Part] = {}
        for part in sorted(parts, key=lambda part: part.first):
            if part.first >= self.given:  # a server died before the row of a part that it had cut was written
                self.put(part)

    @property
    def given(self) -> int:
        """Nothing behind it was given out."""
        return max((part.end for part in self._parts.values()), default=self.merged)

    @property
    def parts(self) -> list[Part]:
        return [self._parts[first] for first in sorted(self._parts)]

    @property
    def board(self) -> Board:
        """What is merged, or in any part, is taken."""
        board = Board()
        for span in [(0, self.merged), *((part.first, part.end) for part in self._parts.values())]:
            board.take(span)
        return board

    def put(self, part: Part) -> None:
        self._parts[part.first] = part

    def ends(self, part: Part) -> bool:
        """Nobody takes it any more: it is done, or waits. False: it was cut meanwhile, and what was taken is of no use."""
        cut = self.is_cut(part)
        self.put(_anew(part, self._parts[part.first].end) if cut else part)
        return not cut

    def is_cut(self, part: Part) -> bool:
        """It was shortened after it had been given out so."""
        return self._parts[part.first].end != part.end

    def cut(self, goal: int) -> list[Part]:
        """The parts across that number, as they were: they end there now, and have no sample. One that is being taken goes on
        being that until it `ends`."""
        across = [self._parts[first] for first, _ in self.board.across(goal) if first >= self.merged]
        for part in across:
            self.put(replace(part, end=goal) if part.state is PartState.RUNNING else _anew(part, goal))
        return across

    def waiting(self) -> Part | None:
        """The first that was given out, and came back."""
        return next((part for part in self.parts if part.state is PartState.WAITING), None)

    def done_from(self, goal: int) -> int:
        """How many parts from that number on are done."""
        return sum(part.first >= goal and part.state is PartState.DONE for part in self._parts.values())

    def to_merge(self, goal: int) -> list[Part]:
        """Those that are done and follow what is merged without a gap, up to that number."""
        found: list[Part] = []
        end = self.merged
        for part in self.parts:
            if part.first != end or part.end > goal or part.state is not PartState.DONE:
                break
            found.append(part)
            end = part.end
        return found

    def merge(self, end: int) -> list[Part]:
        """So many samples are merged now; the parts that had them."""
        gone = [part for part in self.parts if part.end <= end]
        for part in gone:
            del self._parts[part.first]
        self.merged = end
        return gone

    def taken(self) -> int:
        """Samples that are merged, or in parts that are done."""
        return self.merged + sum(part.samples for part in self._parts.values() if part.state is PartState.DONE)


def waits_again(part: Part) -> Part:
    return replace(part, state=PartState.WAITING, claim="")


def _anew(part: Part, end: int) -> Part:
    return Part(part.job_id, part.frame, part.first, end)
