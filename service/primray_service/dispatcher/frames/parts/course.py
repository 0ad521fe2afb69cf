"""What a frame in parts does next, and when it has all samples that it will have. Pure: time is an argument.

By an error it ends where one render does: the error decides at the same numbers of samples (goals), of all samples up to there
and of no others. So no part is merged beyond the goal, and one that lies across it is rendered anew, up to it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from primray.parts.board import MOST_AHEAD, Range
from primray.sampling.schedule import FIRST_ANCHOR

from ....jobs import Frame, Json, Part, PartState
from .cutting import Known, next_samples, rules_of
from .ledger import Ledger


@dataclass(frozen=True)
class Judged:
    """What the error of all that is merged decides: it is the target's or less; or else, at how many samples it is looked at
    next, and at how many the target should be met, if that is known."""

    target_met: bool
    goal: int
    expected: int | None


class Course:
    """`ledger`: where samples are; `known`: what they take; `target_met`: by what is merged. `goal`: the samples at which the
    error decides next, or all of them; None: that of what is merged is to be judged first."""

    def __init__(self, stop: Json, places: int) -> None:
        self.rules = rules_of(stop)
        self.known = Known(places)
        self.ledger = Ledger(0, ())
        self.target_met = False
        self.goal: int | None = None
        self._expected: int | None = None
        self._asked: int | None = stop.get("max_samples")

    def begin(self, frame: Frame, parts: Iterable[Part]) -> None:
        """From what was merged, and taken, before."""
        self.ledger = Ledger(frame.merged, parts)
        self.goal = None
        if self.rules.target is None:
            self.goal = self.rules.most
        elif not frame.merged:
            self._aim(FIRST_ANCHOR)

    def took(self, samples: int, sampled_s: float, load_s: float) -> None:
        """A part of so many samples is done."""
        each, known = max(sampled_s, 1e-6) / samples, self.known.sample_s
        self.known = replace(self.known, sample_s=each if known is None else (known + each) / 2, load_s=load_s)

    def merged(self, end: int, judged: Judged | None) -> list[Part]:
        """The first `end` samples are, and were judged so where an error is asked for; the parts whose files nobody needs."""
        gone = self.ledger.merge(end)
        if judged is None or self.rules.target is None:
            return gone
        self.target_met, self._expected = judged.target_met, judged.expected
        return gone if self.target_met else gone + self._aim(judged.goal)

    def _aim(self, goal: int) -> list[Part]:
        """Parts that were cut, and that nobody takes."""
        self.goal = min(goal, self.rules.most)
        return [part for part in self.ledger.cut(self.goal) if part.state is not PartState.RUNNING]

    @property
    def expected_end(self) -> int | None:
        """Samples after which the frame should be over by its error or its samples; None: that is not known yet."""
        if self.rules.target is None:
            return self.rules.most
        return None if self._expected is None else min(self._expected, self.rules.most)

    def to_merge(self) -> list[Part]:
        return [] if self.goal is None else self.ledger.to_merge(self.goal)

    def is_merge_awaited(self, frame: Frame, *, runs: bool) -> bool:
        """The error decides by the next merge, or it makes the frame whole; or places that wait for others' parts can put
        together what is there, so that less is left to do then. `runs`: parts do."""
        if self.target_met:
            return False
        if self.goal is None:
            return True
        parts = self.to_merge()
        if not parts:
            return False
        return parts[-1].end == self.goal or ((len(parts) > 1 or not runs) and self.next_part(frame) is None)

    def at(self, elapsed_s: float, allowed_s: float) -> None:
        """A time limit that was asked for decides how large parts are; what is allowed in any case only ends the frame."""
        left = allowed_s - elapsed_s
        if self.rules.seconds is not None:
            left = min(left, self.rules.seconds - elapsed_s)
        elif left > 0:
            return
        self.known = replace(self.known, left_s=left)

    @property
    def is_out_of_time(self) -> bool:
        """And there are samples to show."""
        has_some = self.ledger.merged > 0 or bool(self.to_merge())
        return has_some and self.known.left_s is not None and self.known.left_s <= 0

    def next_part(self, frame: Frame) -> Part | None:
        """The first samples that nobody takes: of a part that came back, or a new one; None: none is to be given out now."""
        if self.goal is None or self.target_met or self.is_out_of_time:
            return None
        waiting, new = self.ledger.waiting(), self._next_range(self.goal)
        if waiting is not None and (new is None or waiting.first < new[0]):
            return waiting
        return None if new is None else Part(frame.job_id, frame.number, *new)

    def _next_range(self, goal: int) -> Range | None:
        board = self.ledger.board
        end = board.reach(goal, self.expected_end, self.rules.most)
        if end > goal and self.ledger.done_from(goal) >= MOST_AHEAD * self.known.places:
            return None
        samples = next_samples(board.left(end), self.known)
        return board.next_part(goal, end, samples) if samples else None

    def is_sampled(self, frame: Frame, *, runs: bool, merges: bool) -> bool:
        """All that it will have is merged. `runs`: parts of it do; `merges`: some are being merged."""
        if self.target_met:
            return True
        if self.goal is None:
            return self.is_out_of_time and not merges
        if self.ledger.merged >= self.rules.most:
            return True
        if merges or not self.ledger.merged or self.to_merge():
            return False
        nothing_comes = not runs and self.next_part(frame) is None
        return self.is_out_of_time or (nothing_comes and self.known.left_s is not None)

    @property
    def end(self) -> tuple[int, bool]:
        """Once it is sampled: the samples of its picture, one more than parts can take where an odd number is asked for; and
        whether it is out of time."""
        merged = self.ledger.merged
        is_whole = merged >= self.rules.most
        if is_whole and self._asked is not None and not self.target_met:
            return max(self._asked, merged), False
        return merged, not is_whole and not self.target_met
