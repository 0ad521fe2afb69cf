"""How long frames took lately, by scene and settings: what a waiting job's estimate is made of.

The server that dispatches notes it, in the store: others read it there, and whoever dispatches next.
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
NEWEST = 0.5  # the weight of the last frame in the mean
NEWS = 0.1  # a change of so much is worth writing down
GOOD_FOR_S = 2.0  # what was read, for those that do not note it themselves

Work = tuple[str, str]


def work_of(job: Job) -> Work:
    """Jobs of the same work take as long; which frames they are does not count, nor their seed."""
    return job.scene_id, _work(job.settings)


@lru_cache(maxsize=1000)
def work_of_text(settings: str) -> str:
    """The second half of `work_of`, of settings as they are stored: most jobs that wait have been seen, or are like others."""
    return _work(json.loads(settings))


def _work(settings: Json) -> str:
    asked = {name: value for name, value in settings.items() if name not in ("frames", "seed")}
    return json.dumps(asked, sort_keys=True)


def key_of(work: Work) -> str:
    """A work's name in the store."""
    return hashlib.sha256("\0".join(work).encode()).hexdigest()


class Rates:
    """May be used from any thread; `read`: what the store has, by `key_of`, those noted first first."""

    def __init__(self, read: Callable[[], Mapping[str, float]] = dict) -> None:
        self._read = read
        self._seconds: OrderedDict[str, float] = OrderedDict()
        self._kept: dict[str, float] = {}  # what the store has of what was noted here
        self._until = 0.0  # what was read is good, by the monotonic clock
        self._lock = threading.Lock()

    def note(self, job: Job, seconds: float) -> tuple[str, float] | None:
        """A frame of this job has ended, and had a slot for so long. What the store is to keep, a work's key and its seconds,
        where that is news: most frames take as long as the one before."""
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
        """Take over what the store has, unless that was done a moment ago. Blocks."""
        if time.monotonic() < self._until:
            return
        found = self._read()
        with self._lock:
            self._seconds = OrderedDict(found)
            self._until = time.monotonic() + GOOD_FOR_S

    def of(self, work: Work) -> float | None:
        """Seconds a frame; None if nothing is known."""
        with self._lock:
            return self._seconds.get(key_of(work))
