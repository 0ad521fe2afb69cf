"""The order in which waiting jobs begin, for the positions that clients see; turns.py claims in the same order.

Higher priorities go first. Among equals it is the turn of the tenant with the fewest running frames, and then of the oldest
job. Transient criteria are left out (quotas; which of several equal tenants was served last).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Waiting:
    """A job with claimable frames; `begun`: others of its frames ran already, or run."""

    job_id: str
    tenant: str
    priority: int
    created_at: float
    frames: int = 1  # waiting frames
    begun: bool = False
    work: tuple[str, str] = ("", "")  # scene and settings, for rates.py


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
