"""The order of jobs: which waiting ones begin next, and which running frames yield to them. Pure.

Higher priorities go first. Among equals it is the turn of the tenant with the fewest running frames, and then of the oldest
job. Positions that clients see leave out transient criteria: quotas, and which of several equal tenants was served last.

Turns are the frames that are claimed next, several at once, as if each were claimed alone after the ones before it. They follow
the same order and add those criteria. Preemption uses the order too.
"""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Waiting:
    """A job with claimable frames; `begun`: others of its frames ran already, or run."""

    job_id: str
    tenant: str
    priority: int
    created_at: float
    frames: int = 1  # waiting frames
    begun: bool = False
    work: tuple[str, str] = ("", "")  # scene and settings, for estimates.py


def in_order(waiting: Iterable[Waiting], running: Mapping[str, int]) -> list[Waiting]:
    """Return the jobs in order. `running`: frames of each tenant. A tenant's jobs begin one after another, a frame at each of
    its turns."""
    turns: defaultdict[tuple[str, int], int] = defaultdict(int)
    keys: dict[str, tuple[int, int, float, str]] = {}
    oldest_first = sorted(waiting, key=lambda job: (job.created_at, job.job_id))
    for job in oldest_first:
        mine = turns[job.tenant, job.priority]
        keys[job.job_id] = (-job.priority, running.get(job.tenant, 0) + mine, job.created_at, job.job_id)
        turns[job.tenant, job.priority] += job.frames
    return sorted(oldest_first, key=lambda job: keys[job.job_id])


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


Key = tuple[str, int, *tuple[int, ...]]  # job, frame, and for a part its first sample


@dataclass(frozen=True)
class Running:
    """Frame, or part of one, that holds a slot; `going`: it yields already, or ends soon anyway."""

    key: Key
    priority: int
    tenant: str
    ran_s: float  # seconds of sampling; loading does not count, or a frame that loads slowly would never progress
    going: bool = False


def frames_to_preempt(running: Sequence[Running], waiting: Sequence[tuple[int, str]], slice_s: float) -> list[Key]:
    """Return the keys of frames to preempt. `waiting`: the best waiting job of each tenant, as (priority, tenant).

    Higher priority preempts at once. Tenants of equal priority take turns if there are fewer slots than tenants, and otherwise
    share the slots as evenly as possible; a frame is preempted after it has run for its time slice.
    """
    slots = Counter(frame.tenant for frame in running if not frame.going)
    staying = [frame for frame in running if not frame.going]
    on_the_way = len(running) - len(staying)  # slots that will be free without preemption
    told = []
    for priority, tenant in sorted(waiting, key=lambda job: (-job[0], slots[job[1]], job[1])):
        if on_the_way > 0:
            on_the_way -= 1
            continue
        lower = [frame for frame in staying if frame.priority < priority]
        equal = [frame for frame in staying if frame.priority == priority and _is_fairer(slots, frame.tenant, tenant)]
        equal = [frame for frame in equal if frame.ran_s >= slice_s]
        candidates = lower or equal
        if not candidates:
            continue
        chosen = min(candidates, key=lambda frame: (frame.priority, -slots[frame.tenant], -frame.ran_s, frame.key))
        told.append(chosen.key)
        staying.remove(chosen)
        slots[chosen.tenant] -= 1
        slots[tenant] += 1
    return told


def _is_fairer(slots: Counter[str], running: str, waiting: str) -> bool:
    """Return whether moving one slot from one tenant to the other is fairer. With a difference of one the slot would alternate,
    which is fair only if the other has none."""
    if running == waiting:
        return False
    return slots[waiting] == 0 or slots[running] - slots[waiting] >= 2
