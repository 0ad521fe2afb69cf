"""What a frame in parts does next, and when it has all samples that it will have. Pure: time is an argument."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from ....jobs import Frame, Json, Part
from .cutting import Known, next_samples, rules_of
from .ledger import Ledger


class Course:
    """`ledger`: where samples are; `known`: what was measured; `target_met`: by what is merged."""

    def __init__(self, stop: Json, places: int) -> None:
        self.rules = rules_of(stop)
        self.known = Known(places)
        self.ledger = Ledger(0, ())
        self.target_met = False
        self._asked: int | None = stop.get("max_samples")

    def begin(self, frame: Frame, parts: Iterable[Part]) -> None:
        """From what was merged, and taken, before."""
        self.ledger = Ledger(frame.merged, parts)
        error = (frame.progress.get("error") or {}) if frame.merged else {}
        self.known = replace(self.known, merged=frame.merged, error=error.get("estimate"))

    def took(self, samples: int, sampled_s: float, load_s: float) -> None:
        """A part of so many samples is done."""
        each, known = max(sampled_s, 1e-6) / samples, self.known.sample_s
        self.known = replace(self.known, sample_s=each if known is None else (known + each) / 2, load_s=load_s)

    def merged(self, end: int, error: float | None, *, target_met: bool) -> list[Part]:
        """The first `end` samples are; the parts that had them."""
        self.known = replace(self.known, merged=end, error=error)
        self.target_met = target_met and self.rules.target is not None
        return self.ledger.merge(end)

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
        has_some = self.ledger.merged > 0 or bool(self.ledger.to_merge())
        return has_some and self.known.left_s is not None and self.known.left_s <= 0

    def next_part(self, frame: Frame) -> Part | None:
        """Of those that came back the first, else a new one; None: none is to be given out now."""
        if self.target_met or self.is_out_of_time:
            return None
        waiting = self.ledger.waiting()
        if waiting is not None:
            return waiting
        given = self.ledger.given
        samples = next_samples(given, self.rules, self.known)
        return Part(frame.job_id, frame.number, given, given + samples) if samples else None

    def is_sampled(self, frame: Frame, *, runs: bool, merges: bool) -> bool:
        """All that it will have is merged. `runs`: parts of it do; `merges`: some are being merged."""
        if self.target_met or self.ledger.merged >= self.rules.most:
            return True
        if merges or not self.ledger.merged or self.ledger.to_merge():
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
