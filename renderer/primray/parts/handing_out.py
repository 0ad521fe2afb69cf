"""Submission of ranges to an executor; results are files or losses, and lost ranges are submitted again."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path

from ..errors import PrimrayError
from ..settings import RenderSettings
from .asked import part_settings
from .board import Board, Range
from .executor import PartLost, PartsExecutor

LOOK_EVERY_S = 0.1
MOST_LOST = 5  # lost parts in a row for each slot, after which the frame fails
NOWHERE_S = 300.0  # the frame fails after this long without a slot

Wanted = Callable[[int], Range | None]  # the next range to render, given the number of slots


@dataclass(frozen=True)
class Arrived:
    part: Range
    file: Path
    wall_s: float  # since it was submitted


@dataclass(frozen=True)
class _Given:
    part: Range
    file: Path
    at: float


class HandingOut:
    """Parts in flight. `board` knows all assigned and finished ranges; files are written to `folder`."""

    def __init__(self, executor: PartsExecutor, asked: RenderSettings, folder: Path) -> None:
        self.board = Board()
        self.most_slots = 0
        self.lost = 0
        self.left_out = 0  # parts rendered or started, and discarded
        self._executor = executor
        self._asked = asked
        self._folder = folder
        self._given: dict[Future[None], _Given] = {}
        self._made = 0
        self._lost_in_a_row = 0
        self._slot_seen = time.monotonic()

    def give(self, wanted: Wanted) -> None:
        """Submit parts while there are free slots; PrimrayError if there has been no slot for long."""
        slots = self._executor.slots()
        self.most_slots = max(self.most_slots, slots)
        if slots:
            self._slot_seen = time.monotonic()
        elif time.monotonic() - self._slot_seen > NOWHERE_S:
            raise PrimrayError(f"no worker was available for {NOWHERE_S:g} s", code="parts-nowhere")
        while len(self._given) < slots and (part := wanted(slots)) is not None:
            self._made += 1
            given = _Given(part, self._folder / f"{part[0]}-{part[1]}-{self._made}.prc", time.monotonic())
            self.board.take(part)
            self._given[self._executor.submit(part_settings(self._asked, part), given.file)] = given

    def arrived(self) -> list[Arrived]:
        """Return parts that finished, after a short wait; PrimrayError for errors that any part would have, and too many
        losses."""
        wait(list(self._given), LOOK_EVERY_S, FIRST_COMPLETED)
        if not self._given:
            time.sleep(LOOK_EVERY_S)
        found = []
        for future in [future for future in self._given if future.done()]:
            given = self._given.pop(future)
            try:
                future.result()
            except PartLost as lost:
                self.is_lost(given.part, str(lost))
            else:
                found.append(Arrived(given.part, given.file, time.monotonic() - given.at))
        return found

    def is_lost(self, part: Range, why: str) -> None:
        """Free the range for another attempt; PrimrayError after too many losses in a row."""
        self.board.give_back(part)
        self.lost += 1
        self._lost_in_a_row += 1
        if self._lost_in_a_row > MOST_LOST * max(self.most_slots, 1):
            sentence = f"{self._lost_in_a_row} parts in a row were lost; the last: {why}"
            raise PrimrayError(sentence, where=f"samples {part[0]}:{part[1]}", code="parts-lost")

    def is_used(self) -> None:
        """Reset the count of losses in a row: a part was complete."""
        self._lost_in_a_row = 0

    def is_left_out(self, part: Range) -> None:
        self.board.give_back(part)
        self.left_out += 1

    def drop(self, parts: list[Range] | None = None) -> None:
        """Cancel these parts (None: all)."""
        for future, given in list(self._given.items()):
            if parts is None or given.part in parts:
                del self._given[future]
                future.cancel()
                self.is_left_out(given.part)
