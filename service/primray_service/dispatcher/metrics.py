"""Counters of the dispatcher, as plain numbers that /metrics reads; written in the event loop only."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

WAIT_S = (0.05, 0.1, 0.25, 0.5, 1.0, 5.0, 30.0, 300.0, 3600.0)
SHORT_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0)


@dataclass
class Timings:
    """Histogram: `counts[i]` observations were at most `buckets[i]` and above the bucket before; the last count has the
    others."""

    buckets: Sequence[float]
    counts: list[int] = field(default_factory=list)
    total_s: float = 0.0

    def __post_init__(self) -> None:
        self.counts = [0] * (len(self.buckets) + 1)

    def observe(self, seconds: float) -> None:
        place = next((i for i, most in enumerate(self.buckets) if seconds <= most), len(self.buckets))
        self.counts[place] += 1
        self.total_s += seconds

    @property
    def count(self) -> int:
        return sum(self.counts)


@dataclass(kw_only=True)
class Metrics:
    frames_started: int = 0
    # By the frame's state, or for failed ones by the problem's slug: "succeeded", "canceled", "memory-limit", ...
    frames_ended: Counter[str] = field(default_factory=Counter)
    # Frames queued again, by reason: "yield", "crash", "kill", "shutdown", "storage", ...
    restarts: Counter[str] = field(default_factory=Counter)
    checkpoints: int = 0
    checks_ended: Counter[str] = field(default_factory=Counter)  # "ready", or the problem's slug
    leases: int = 0  # times that this server acquired the lease, and lost it unintentionally
    leases_lost: int = 0
    holds_lease: bool = False
    running: int = 0
    worker_cpu_s: float = 0.0  # of render workers that have ended
    jobs_deleted: int = 0
    queue_wait: Timings = field(default_factory=lambda: Timings(WAIT_S))  # from queued to claimed, per frame
    first_sample: Timings = field(default_factory=lambda: Timings(WAIT_S))  # from claimed to sampling
    adopt_checkpoint: Timings = field(default_factory=lambda: Timings(SHORT_S))  # from the message to the row
    end_frame: Timings = field(default_factory=lambda: Timings(SHORT_S))  # from the last message to the row
