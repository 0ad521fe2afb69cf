"""Positions of queued jobs and their estimated starts, for clients; and the recent durations of frames that estimates rest on.

The estimates are pure; one read of the queue serves all who ask within a moment. Durations are by scene and settings. The
dispatching server records them in the store: others read them there, and so does the next dispatcher.
"""

from __future__ import annotations

import hashlib
import json
import logging
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache

from ..jobs import Job, JobState, Json
from ..store.base import Store
from .order import Waiting, in_order

MOST_RATES = 1000
NEWEST = 0.5  # weight of the newest frame in the mean
NEWS = 0.1  # smallest relative change that is worth storing
RATES_GOOD_FOR_S = 2.0  # lifetime of what was read, on servers that do not record it

Work = tuple[str, str]


def work_of(job: Job) -> Work:
    """Return a job's work: jobs of the same work take as long; the frames' numbers and the seed do not count."""
    return job.scene_id, _work(job.settings)


@lru_cache(maxsize=1000)
def work_of_text(settings: str) -> str:
    """Return the second half of `work_of` from settings as they are stored; cached, since most waiting jobs were seen before,
    or are like others."""
    return _work(json.loads(settings))


def _work(settings: Json) -> str:
    asked = {name: value for name, value in settings.items() if name not in ("frames", "seed")}
    return json.dumps(asked, sort_keys=True)


def key_of(work: Work) -> str:
    """Return a work's name in the store."""
    return hashlib.sha256("\0".join(work).encode()).hexdigest()


class Rates:
    """Durations by work. Thread-safe; `read`: the store's records by `key_of`, in order of recording."""

    def __init__(self, read: Callable[[], Mapping[str, float]] = dict) -> None:
        self._read = read
        self._seconds: OrderedDict[str, float] = OrderedDict()
        self._kept: dict[str, float] = {}  # stored values of what was recorded here
        self._until = 0.0  # end of the validity of what was read, by the monotonic clock
        self._lock = threading.Lock()

    def note(self, job: Job, seconds: float) -> tuple[str, float] | None:
        """Record that a frame of this job has ended and held a slot for that long. Returns a work's key and seconds for the
        store if they have changed: most frames take as long as the one before."""
        key = key_of(work_of(job))
        with self._lock:
            before = self._seconds.pop(key, seconds)
            self._seconds[key] = now = before + NEWEST * (seconds - before)
            if len(self._seconds) > MOST_RATES:
                self._seconds.popitem(last=False)
            if abs(now - self._kept.get(key, 0.0)) <= NEWS * now:
                return None
            if len(self._kept) >= MOST_RATES:
                self._kept.clear()
            self._kept[key] = now
        return key, now

    def refresh(self) -> None:
        """Read the store's records, unless that was done a moment ago. Blocks."""
        if time.monotonic() < self._until:
            return
        found = self._read()
        with self._lock:
            self._seconds = OrderedDict(found)
            self._until = time.monotonic() + RATES_GOOD_FOR_S

    def of(self, work: Work) -> float | None:
        """Return the seconds per frame; None if unknown."""
        with self._lock:
            return self._seconds.get(key_of(work))


LOG = logging.getLogger(__name__)

MOST = 10_000  # queued jobs with a position; those behind them have none yet
GOOD_FOR_S = 0.5
LONG_S = 0.03  # slower reads are not waited for: callers get the previous result meanwhile
REST = 10.0  # pause until the next read, as a multiple of the last one's duration


@dataclass(frozen=True)
class _Seen:
    at: float = float("-inf")  # by the clock that jobs are queued by
    positions: Mapping[str, Place] = field(default_factory=dict)


class Positions:
    """Positions of queued jobs. Thread-safe; blocks on the database. `slots`: their current number."""

    def __init__(self, store: Store, slots: Callable[[], int], rates: Rates) -> None:
        self._store = store
        self._slots = slots
        self._rates = rates
        self._seen = _Seen()
        self._took_s = 0.0
        self._lock = threading.Lock()

    def of(self, job: Job) -> Json | None:
        """Return the job's position; None unless it is queued; its members are null while unknown."""
        if job.state != JobState.QUEUED:
            return None
        seen = self._seen_now(job)
        found, waiting = seen.positions.get(job.id), len(seen.positions)
        if found is None:  # its scene is being checked, or it has just begun
            return {"place": None, "waiting": waiting, "frames_ahead": None, "estimated_start_s": None}
        start_s = None if found.start_s is None else round(found.start_s, 1)
        return {
            "place": found.place,
            "waiting": waiting,
            "frames_ahead": found.frames_ahead,
            "estimated_start_s": start_s,
        }

    def _seen_now(self, job: Job) -> _Seen:
        if self._took_s > LONG_S:
            if time.time() >= self._seen.at + max(GOOD_FOR_S, REST * self._took_s) and self._lock.acquire(blocking=False):
                threading.Thread(target=self._look_beside, name="positions", daemon=True).start()
            return self._seen
        with self._lock:
            now = time.time()
            if not self._seen.at <= now < self._seen.at + GOOD_FOR_S or self._seen.at <= job.queued_at:
                self._look_again(now)
            return self._seen

    def _look_beside(self) -> None:
        """Read the queue; called under the lock, and releases it."""
        try:
            self._look_again(time.time())
        except Exception:
            LOG.warning("the queue could not be read", exc_info=True)
            self._took_s = 0.0  # the next caller waits, and gets the error
        finally:
            self._lock.release()

    def _look_again(self, now: float) -> None:
        began = time.monotonic()
        self._seen = _Seen(now, self._look(now))
        self._took_s = time.monotonic() - began

    def _look(self, now: float) -> Mapping[str, Place]:
        queue = self._store.queue(MOST)
        self._rates.refresh()
        running: Counter[str] = Counter()
        for job, frames in queue.active:
            running[job.tenant] += frames
        active = [Active(job.priority, frames, _left_s(job, now)) for job, frames in queue.active]
        return positions_of(in_order(queue.waiting, running), active, self._slots(), lambda job: self._rates.of(job.work))


def _left_s(job: Job, now: float) -> float | None:
    """Return the seconds until the job is done by its last report, which is some seconds old."""
    eta_s, updated_at = job.progress.get("eta_s"), job.progress.get("updated_at")
    if eta_s is None or updated_at is None:
        return None
    return max(float(eta_s) - max(now - datetime.fromisoformat(updated_at).timestamp(), 0.0), 0.0)


@dataclass(frozen=True)
class Active:
    """A job with running frames; `left_s`: until it is done, including waiting frames, None if unknown."""

    priority: int
    frames_running: int
    left_s: float | None


@dataclass(frozen=True)
class Place:
    place: int  # 1: the next to begin
    frames_ahead: int  # frames that run or will be claimed before its first
    start_s: float | None  # seconds from now; None: unknown


def positions_of(
    order: Sequence[Waiting], active: Sequence[Active], slots: int, seconds_of: Callable[[Waiting], float | None]
) -> Mapping[str, Place]:
    """Return the positions of jobs that have not begun. Frames of lower priority are preempted, so they are not waited for."""
    found: dict[str, Place] = {}
    before: dict[int, tuple[int, float | None]] = {}  # running work, by the priority of the waiting job
    claimed = 0
    ahead_s: float | None = 0.0  # slot seconds of jobs that have not begun
    for job in order:
        if not job.begun:
            if job.priority not in before:
                before[job.priority] = _added_up([other for other in active if other.priority >= job.priority])
            running, running_s = before[job.priority]
            start_s = _start_s(running_s, ahead_s, running + claimed, slots)
            found[job.job_id] = Place(len(found) + 1, running + claimed, start_s)
            each = seconds_of(job)
            ahead_s = None if each is None or ahead_s is None else ahead_s + job.frames * each
        claimed += job.frames
    return found


def _added_up(active: Sequence[Active]) -> tuple[int, float | None]:
    """Return the number of running frames, and the slot seconds until all are done; None if one of those is unknown."""
    left = [job.left_s * job.frames_running for job in active if job.left_s is not None]
    return sum(job.frames_running for job in active), sum(left) if len(left) == len(active) else None


def _start_s(running_s: float | None, ahead_s: float | None, frames_ahead: int, slots: int) -> float | None:
    if frames_ahead < slots:
        return 0.0
    if not slots or running_s is None or ahead_s is None:  # without slots, the time of the next is unknown
        return None
    return (running_s + ahead_s) / slots
