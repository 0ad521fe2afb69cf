"""Quotas of tenants: a token bucket of requests for each key, and the answer when a quota is used up. No HTTP here."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from ..limits import Quotas
from ..problems import Problem
from ..store.base import Usage

DAY_S = 86_400.0
SOON_S = 30  # retry delay for quotas that free up whenever a job ends or something is deleted
BUCKETS_KEPT = 10_000


@dataclass(frozen=True)
class Allowance:
    """State of a token bucket as answers report it (draft-ietf-httpapi-ratelimit-headers-10)."""

    is_allowed: bool
    limit: int  # burst size
    per_s: float
    remaining: int
    reset_s: int  # seconds until the bucket is full again
    retry_after_s: int

    def headers(self) -> dict[str, str]:
        window = max(1, math.ceil(self.limit / self.per_s))
        return {
            "ratelimit-policy": f'"requests";q={self.limit};w={window}',
            "ratelimit": f'"requests";r={self.remaining};t={self.reset_s}',
        }

    def problem(self) -> Problem:
        return Problem(
            "too-many-requests",
            f"{self.per_s:g} requests a second are allowed, and {self.limit} at once; wait {self.retry_after_s} s.",
            headers={"retry-after": str(self.retry_after_s), **self.headers()},
        )


class RequestRates:
    """Token buckets by key or tenant, in this process: each of several servers counts its own requests. Thread-safe."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._buckets: dict[str, tuple[float, float]] = {}  # (tokens, time when they were counted) by key or tenant
        self._lock = threading.Lock()

    def take(self, who: str, quotas: Quotas) -> Allowance | None:
        """Take one token and return the bucket's state; None if there is no limit."""
        if quotas.requests_per_s is None:
            return None
        rate, burst = quotas.requests_per_s, max(1, quotas.burst)
        now = self._clock()
        with self._lock:
            tokens, then = self._buckets.get(who, (float(burst), now))
            tokens = min(float(burst), tokens + (now - then) * rate)
            is_allowed = tokens >= 1.0
            if is_allowed:
                tokens -= 1.0
            self._buckets[who] = (tokens, now)
            if len(self._buckets) > BUCKETS_KEPT:
                self._forget_full(now, rate, burst)
        wait = 0 if is_allowed else max(1, math.ceil((1.0 - tokens) / rate))
        return Allowance(is_allowed, burst, rate, int(tokens), math.ceil((burst - tokens) / rate), wait)

    def _forget_full(self, now: float, rate: float, burst: int) -> None:
        """Drop buckets that have had time to fill up: a full bucket and no bucket are equivalent."""
        self._buckets = {
            who: (tokens, then) for who, (tokens, then) in self._buckets.items() if tokens + (now - then) * rate < burst
        }


def exceeded(quota: str, quotas: Quotas, usage: Usage, coming: int = 0) -> Problem:
    """Return the answer for an exceeded quota; `coming` is what the request would have added."""
    limit = getattr(quotas, quota)
    used = {
        "queued_jobs": usage.queued_jobs,
        "running_jobs": usage.running_jobs,
        "stored_bytes": usage.stored_bytes,
        "cpu_s_per_day": usage.cpu_s_today,
    }[quota]
    what = {
        "queued_jobs": "jobs may be queued",
        "running_jobs": "jobs may run at the same time",
        "stored_bytes": "bytes may be stored",
        "cpu_s_per_day": "CPU seconds may be used per day (UTC)",
    }[quota]
    more = f"; this request needs {coming:,} more" if coming else ""
    sentence = f"{limit:,} {what}, and {used:,.0f} are in use{more}."
    if quota == "stored_bytes":  # waiting frees nothing
        sentence = f"{sentence} Delete scenes or jobs that are no longer needed."
        return Problem("quota-exceeded", sentence, retryable=False, quota=quota, limit=limit, used=used)
    wait = math.ceil(DAY_S - time.time() % DAY_S) if quota == "cpu_s_per_day" else SOON_S
    return Problem(
        "quota-exceeded",
        sentence,
        headers={"retry-after": str(wait)},
        quota=quota,
        limit=limit,
        used=used,
    )
