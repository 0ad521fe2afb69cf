"""Recent durations of frames by scene and settings, for the estimates of waiting jobs.

The dispatching server records them in the store: others read them there, and so does the next dispatcher.
"""

from __future__ import annotations

import hashlib
import json
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import lru_cache

from ..jobs import Job, Json

MOST = 1000
NEWEST = 0.5  # weight of the newest frame in the mean
NEWS = 0.1  # smallest relative change that is worth storing
GOOD_FOR_S = 2.0  # lifetime of what was read, on servers that do not record it

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
            if len(self._seconds) > MOST:
                self._seconds.popitem(last=False)
            if abs(now - self._kept.get(key, 0.0)) <= NEWS * now:
                return None
            if len(self._kept) >= MOST:
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
            self._until = time.monotonic() + GOOD_FOR_S

    def of(self, work: Work) -> float | None:
        """Return the seconds per frame; None if unknown."""
        with self._lock:
            return self._seconds.get(key_of(work))
