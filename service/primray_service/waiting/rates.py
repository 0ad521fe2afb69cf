"""How long frames took lately, by scene and settings: what a waiting job's estimate is made of. Forgotten with the server."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from functools import lru_cache

from ..jobs import Job, Json

MOST = 1000
NEWEST = 0.5  # the weight of the last frame in the mean

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


class Rates:
    """May be used from any thread."""

    def __init__(self) -> None:
        self._seconds: OrderedDict[Work, float] = OrderedDict()
        self._lock = threading.Lock()

    def note(self, job: Job, seconds: float) -> None:
        """A frame of this job has ended, and had a slot for so long."""
        work = work_of(job)
        with self._lock:
            before = self._seconds.pop(work, seconds)
            self._seconds[work] = before + NEWEST * (seconds - before)
            if len(self._seconds) > MOST:
                self._seconds.popitem(last=False)

    def of(self, work: Work) -> float | None:
        """Seconds a frame; None if nothing is known."""
        with self._lock:
            return self._seconds.get(work)
