"""Which samples of a frame are merged, which are taken and wait for that, which are being taken. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from ....jobs import Part, PartState


class Ledger:
    """Parts are disjoint and without gaps from `merged` to `given`."""

    def __init__(self, merged: int, parts: Iterable[Part]) -> None:
        self.merged = merged
        self._parts: dict[int, Part] = {}
        for part in sorted(parts, key=lambda part: part.first):
            if part.first == self.given:  # what is beyond a gap was left by a server that died between two rows
                self.put(part)

    @property
    def given(self) -> int:
        """Where the next new part begins."""
        return max((part.end for part in self._parts.values()), default=self.merged)

    @property
    def parts(self) -> list[Part]:
        return [self._parts[first] for first in sorted(self._parts)]

    def put(self, part: Part) -> None:
        self._parts[part.first] = part

    def waiting(self) -> Part | None:
        """The first that was given out, and came back."""
        return next((part for part in self.parts if part.state is PartState.WAITING), None)

    def to_merge(self) -> list[Part]:
        """Those that are done and follow what is merged without a gap."""
        found: list[Part] = []
        end = self.merged
        for part in self.parts:
            if part.first != end or part.state is not PartState.DONE:
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
