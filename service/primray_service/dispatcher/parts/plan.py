"""Plan of a frame in parts: what is rendered and merged next, and when the frame is complete. Pure: time is an argument.

With a target error the frame ends where a single render does: the error is measured at the same numbers of samples (goals),
over exactly the samples up to there. So no part is merged beyond the goal, and a part across it is rendered again, up to it.

The ledger has the frame's samples: which are merged, which are done and wait for a merge, which are in progress.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from primray.distributed.planner import MOST_AHEAD, AssignedRanges, PartCosts, Range, samples_of_next_part
from primray.sampling.schedule import FIRST_ANCHOR
from primray.settings import DEFAULT_SPP, MAX_SPP, SAMPLE_BLOCK

from ...jobs import Frame, Json, Part, PartState


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


@dataclass(frozen=True)
class Rules:
    """When the frame ends; `most`: samples per pixel that parts can take."""

    most: int
    target: float | None
    seconds: float | None


def rules_of(stop: Json) -> Rules:
    """Return the rules for a job's stop rules."""
    asked, target, limit = stop.get("max_samples"), stop.get("target_error"), stop.get("max_seconds")
    early = target is not None or limit is not None
    most = asked if asked is not None else MAX_SPP if early else DEFAULT_SPP
    return Rules(most // SAMPLE_BLOCK * SAMPLE_BLOCK, target, limit)


@dataclass(frozen=True)
class Judged:
    """Result of measuring the error of all merged samples: the target is reached; or else the number of samples at which it is
    measured next, and the number at which the target should be reached, if known."""

    target_met: bool
    goal: int
    expected: int | None


class Plan:
    """Plan of one frame. `ledger`: where samples are; `costs`: of parts, in one slot; `time_left_s`: None without a limit;
    `target_met`: by the merged samples. `goal`: the samples at which the error is measured next, or all of them; None: that of
    the merged samples is to be measured first."""

    def __init__(self, stop: Json, slots: int) -> None:
        self.rules = rules_of(stop)
        self.slots = slots
        self.costs = PartCosts()
        self.time_left_s: float | None = None
        self.ledger = Ledger(0, ())
        self.target_met = False
        self.goal: int | None = None
        self._expected: int | None = None
        self._asked: int | None = stop.get("max_samples")

    def begin(self, frame: Frame, parts: Iterable[Part]) -> None:
        """Resume from what was merged, and rendered, before."""
        self.ledger = Ledger(frame.merged, parts)
        self.goal = None
        if self.rules.target is None:
            self.goal = self.rules.most
        elif not frame.merged:
            self._aim(FIRST_ANCHOR)

    def took(self, samples: int, sampled_s: float, load_s: float) -> None:
        """Record that a part of that many samples is done."""
        self.costs = self.costs.with_part(samples, sampled_s, load_s)

    def merged(self, end: int, judged: Judged | None) -> list[Part]:
        """Record that the first `end` samples are merged, with their error if one was requested; return the parts whose files
        are no longer needed."""
        gone = self.ledger.merge(end)
        if judged is None or self.rules.target is None:
            return gone
        self.target_met, self._expected = judged.target_met, judged.expected
        return gone if self.target_met else gone + self._aim(judged.goal)

    def _aim(self, goal: int) -> list[Part]:
        """Set the goal and return the parts that were shortened, and are not in progress."""
        self.goal = min(goal, self.rules.most)
        return [part for part in self.ledger.cut(self.goal) if part.state is not PartState.RUNNING]

    @property
    def expected_end(self) -> int | None:
        """Return the number of samples after which the frame should end by its error or its sample limit; None if not known
        yet."""
        if self.rules.target is None:
            return self.rules.most
        return None if self._expected is None else min(self._expected, self.rules.most)

    def to_merge(self) -> list[Part]:
        return [] if self.goal is None else self.ledger.to_merge(self.goal)

    def is_merge_awaited(self, frame: Frame, *, runs: bool) -> bool:
        """Return whether a merge is needed now: the error is measured after it, or it completes the frame; or slots that wait
        for other parts can merge in the meantime, so that less is left for later. `runs`: whether parts run."""
        if self.target_met:
            return False
        if self.goal is None:
            return True
        parts = self.to_merge()
        if not parts:
            return False
        return parts[-1].end == self.goal or ((len(parts) > 1 or not runs) and self.next_part(frame) is None)

    def at(self, elapsed_s: float, allowed_s: float) -> None:
        """Update the time left. A time limit in the job's stop rules determines the size of parts; the server's limit only ends
        the frame."""
        left = allowed_s - elapsed_s
        if self.rules.seconds is not None:
            left = min(left, self.rules.seconds - elapsed_s)
        elif left > 0:
            return
        self.time_left_s = left

    @property
    def is_out_of_time(self) -> bool:
        """Return whether the time is over and there are samples to show."""
        has_some = self.ledger.merged > 0 or bool(self.to_merge())
        return has_some and self.time_left_s is not None and self.time_left_s <= 0

    def next_part(self, frame: Frame) -> Part | None:
        """Return the first samples that nobody renders, from a part that came back or as a new part; None if none is to be
        handed out now."""
        if self.goal is None or self.target_met or self.is_out_of_time:
            return None
        waiting, new = self.ledger.waiting(), self._next_range(self.goal)
        if waiting is not None and (new is None or waiting.first < new[0]):
            return waiting
        return None if new is None else Part(frame.job_id, frame.number, *new)

    def _next_range(self, goal: int) -> Range | None:
        board = self.ledger.board
        end = board.reach(goal, self.expected_end, self.rules.most)
        if end > goal and self.ledger.done_from(goal) >= MOST_AHEAD * self.slots:
            return None
        samples = samples_of_next_part(board.left(end), self.slots, self.costs, self.time_left_s)
        return board.next_part(goal, end, samples) if samples else None

    def is_sampled(self, frame: Frame, *, runs: bool, merges: bool) -> bool:
        """Return whether all samples of the frame are merged. `runs`: parts of it run; `merges`: some are being merged."""
        if self.target_met:
            return True
        if self.goal is None:
            return self.is_out_of_time and not merges
        if self.ledger.merged >= self.rules.most:
            return True
        if merges or not self.ledger.merged or self.to_merge():
            return False
        nothing_comes = not runs and self.next_part(frame) is None
        return self.is_out_of_time or (nothing_comes and self.time_left_s is not None)

    @property
    def end(self) -> tuple[int, bool]:
        """Return, for a complete frame, the samples of its picture, one more than parts can take if an odd number was
        requested; and whether its time is over."""
        merged = self.ledger.merged
        is_whole = merged >= self.rules.most
        if is_whole and self._asked is not None and not self.target_met:
            return max(self._asked, merged), False
        return merged, not is_whole and not self.target_met
