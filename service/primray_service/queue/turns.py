"""Turns: which frames are claimed next, several at once, as if each were claimed alone after the ones before it. Pure.

order.py has the order. Added to it are transient criteria: quotas, and, among tenants with equally many running frames, the one
that was served longest ago.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field


@dataclass
class Head:
    """A job near the front of its tenant's queue. `frames`: waiting and not planned yet; `begun`: it counts as running;
    `alone`: nothing after it is planned until it has begun."""

    job_id: str
    created_at: float
    frames: int
    begun: bool = False
    alone: bool = False

    @property
    def age(self) -> tuple[float, str]:
        return self.created_at, self.job_id


@dataclass
class Tenant:
    """A tenant. `jobs`, `frames`: running ones; `most_jobs`: allowed running jobs; `served`: the number of its last turn, 0:
    none yet."""

    name: str
    jobs: int = 0
    frames: int = 0
    most_jobs: int | None = None
    served: int = 0

    @property
    def may_begin(self) -> bool:
        return self.most_jobs is None or self.jobs < self.most_jobs


@dataclass
class Line:
    """A tenant's jobs of one priority, oldest first. `more` reads jobs that follow one, none if there are none; `begun`: those
    that it may continue if it may start no other."""

    tenant: Tenant
    heads: list[Head]
    begun: list[Head] = field(default_factory=list)
    more: Callable[[Head], list[Head]] = lambda last: []

    def __post_init__(self) -> None:
        self.heads = self._merged(self.heads)

    def _merged(self, heads: list[Head]) -> list[Head]:
        """Return the heads, with one object for each job wherever it is listed."""
        known = {head.job_id: head for head in self.begun}
        return [known.get(head.job_id, head) for head in heads]

    @property
    def order(self) -> tuple[int, int, float, str]:
        """Return the line's rank among lines; a lower bound from its first job, without reading more."""
        age = self.heads[0].age if self.heads and self.tenant.may_begin else (0.0, "")
        return self.tenant.frames, self.tenant.served, *age

    def first(self) -> Head | None:
        if not self.tenant.may_begin:
            left = [head for head in self.begun if head.frames > 0]
            return min(left, key=lambda head: head.age, default=None)
        while self.heads and self.heads[0].frames == 0:
            last = self.heads.pop(0)
            if not self.heads:
                self.heads = self._merged(self.more(last))
        return self.heads[0] if self.heads else None

    def take(self, head: Head, turn: int) -> None:
        head.frames -= 1
        self.tenant.frames += 1
        self.tenant.served = turn
        if not head.begun:
            head.begun = True
            self.tenant.jobs += 1
            self.begun.append(head)


@dataclass
class Plan:
    """Plan of at most `most` frames, by job, the first job first. `turn`: the last one's number."""

    most: int
    turn: int
    frames: Counter[str] = field(default_factory=Counter)
    is_closed: bool = False

    @property
    def is_full(self) -> bool:
        return self.is_closed or self.frames.total() >= self.most

    def fill(self, lines: Iterable[Line]) -> None:
        """Add frames from the lines of one priority, which all precede those of the next."""
        heap = [(*line.order, i, line) for i, line in enumerate(lines)]
        heapq.heapify(heap)
        while heap and not self.is_full:
            *was, i, line = heapq.heappop(heap)
            head = line.first()
            if head is None:
                continue
            if (now := (line.tenant.frames, line.tenant.served, *head.age)) != tuple(was):
                heapq.heappush(heap, (*now, i, line))  # its rank is known only now
                continue
            self.turn += 1
            line.take(head, self.turn)
            self.frames[head.job_id] += 1
            self.is_closed = head.alone
            heapq.heappush(heap, (*line.order, i, line))


def last_turn(served: Mapping[str, int]) -> int:
    return max(served.values(), default=0)
