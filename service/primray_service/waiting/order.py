"""The order in which waiting jobs are begun, for the places that clients see; turns.py claims in the same order.

Larger priorities go first. Among equals it is the tenant's turn that has the fewest frames running, and then the oldest job's.
What only the moment decides (quotas; who was served last, where tenants have equal rights) is not in it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Waiting:
    """A job with frames that could be claimed; `begun`: others of its frames ran already, or run."""

    job_id: str
    tenant: str
    priority: int
    created_at: float
    frames: int = 1  # that wait
    begun: bool = False
    work: tuple[str, str] = ("", "")  # scene and settings, for rates.py


def in_order(waiting: Iterable[Waiting], running: Mapping[str, int]) -> list[Waiting]:
    """`running`: frames of each tenant. A tenant's jobs are begun one after another, a frame each time it is its turn."""
    turns: defaultdict[tuple[str, int], int] = defaultdict(int)
    keys: dict[str, tuple[int, int, float, str]] = {}
    oldest_first = sorted(waiting, key=lambda job: (job.created_at, job.job_id))
    for job in oldest_first:
        mine = turns[job.tenant, job.priority]
        keys[job.job_id] = (-job.priority, running.get(job.tenant, 0) + mine, job.created_at, job.job_id)
        turns[job.tenant, job.priority] += job.frames
    return sorted(oldest_first, key=lambda job: keys[job.job_id])
