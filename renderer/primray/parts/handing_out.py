"""Ranges given to an executor, and what comes of them: files, or losses, which are given out again."""

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
MOST_LOST = 5  # parts in a row for each slot: then it is no accident
NOWHERE_S = 300.0  # without a slot

Wanted = Callable[[int], Range | None]  # what is to be rendered next, with so many slots


@dataclass(frozen=True)
class Arrived:
    part: Range
    file: Path
    wall_s: float  # from its being given out


@dataclass(frozen=True)
class _Given:
    part: Range
    file: Path
    at: float


class HandingOut:
    """`board` knows of all that was given out or has come. Files are put into `folder`."""

    def __init__(self, executor: PartsExecutor, asked: RenderSettings, folder: Path) -> None:
        self.board = Board()
        self.most_slots = 0
        self.lost = 0
        self.left_out = 0  # rendered, or begun, and not needed
        self._executor = executor
        self._asked = asked
        self._folder = folder
        self._given: dict[Future[None], _Given] = {}
        self._made = 0
        self._lost_in_a_row = 0
        self._slot_seen = time.monotonic()

    def give(self, wanted: Wanted) -> None:
        """As much as there are slots for; PrimrayError where there were none for long."""
        slots = self._executor.slots()
        self.most_slots = max(self.most_slots, slots)
        if slots:
            self._slot_seen = time.monotonic()
        elif time.monotonic() - self._slot_seen > NOWHERE_S:
            raise PrimrayError(f"for {NOWHERE_S:g} s there was nowhere to render a part", code="parts-nowhere")
        while len(self._given) < slots and (part := wanted(slots)) is not None:
            self._made += 1
            given = _Given(part, self._folder / f"{part[0]}-{part[1]}-{self._made}.prc", time.monotonic())
            self.board.take(part)
            self._given[self._executor.submit(part_settings(self._asked, part), given.file)] = given

    def arrived(self) -> list[Arrived]:
        """What has come, after a moment's wait for it; PrimrayError for what would befall any part, and too many losses."""
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
        """It is to be given out again."""
        self.board.give_back(part)
        self.lost += 1
        self._lost_in_a_row += 1
        if self._lost_in_a_row > MOST_LOST * max(self.most_slots, 1):
            sentence = f"{self._lost_in_a_row} parts in a row were lost, the last one since {why}"
            raise PrimrayError(sentence, where=f"samples {part[0]}:{part[1]}", code="parts-lost")

    def is_used(self) -> None:
        """A part was whole: losses before it were accidents."""
        self._lost_in_a_row = 0

    def is_left_out(self, part: Range) -> None:
        self.board.give_back(part)
        self.left_out += 1

    def drop(self, parts: list[Range] | None = None) -> None:
        """End what runs of these (None: all)."""
        for future, given in list(self._given.items()):
            if parts is None or given.part in parts:
                del self._given[future]
                future.cancel()
                self.is_left_out(given.part)
