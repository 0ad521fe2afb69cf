"""Quotas of tenants: those in effect, a token bucket of requests for each key, and the answer to an exceeded one. No HTTP here.

Those of a tenant's newest valid key apply, or this server's; settings by an administrator take precedence.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from .auth import Caller
from .limits import Quotas
from .problems import Problem
from .store.base import Usage

if TYPE_CHECKING:
    from .jobs import Json
    from .store.base import Store


DAY_S = 86_400.0
SOON_S = 30  # retry delay for quotas that free up whenever a job ends or something is deleted
BUCKETS_KEPT = 10_000


@dataclass(frozen=True, kw_only=True)
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
        return Allowance(
            is_allowed=is_allowed,
            limit=burst,
            per_s=rate,
            remaining=int(tokens),
            reset_s=math.ceil((burst - tokens) / rate),
            retry_after_s=wait,
        )

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


REMEMBERED_S = 5.0  # upper bound of the time until another server's change takes effect
REMEMBERED = 10_000
NAMES = frozenset(field.name for field in fields(Quotas))


class TenantQuotas:
    """Quotas by tenant, cached for a few seconds. Thread-safe."""

    def __init__(self, store: Store, default: Quotas) -> None:
        self._store = store
        self._default = default
        self._set: dict[str, tuple[float, Json]] = {}
        self._of_keys: dict[str, tuple[float, Quotas]] = {}

    def of(self, tenant: str) -> Quotas:
        """Return the quotas that the queue applies to a tenant, whichever of its keys a job came with. May block on the
        store."""
        found = _remembered(self._of_keys, tenant, lambda: self._newest_keys(tenant))
        return self._changed(found, tenant)

    def of_caller(self, caller: Caller) -> Quotas:
        """Return the quotas of the key that a request came with. May block on the store: see `is_known`."""
        return self._changed(caller.quotas(self._default), caller.tenant)

    def is_known(self, tenant: str) -> bool:
        """Return whether `of_caller` answers without reading the store."""
        known = self._set.get(tenant)
        return known is not None and time.monotonic() - known[0] < REMEMBERED_S

    def forget(self, tenant: str) -> None:
        """Drop a tenant's cached quotas, so that a change made here takes effect at once."""
        self._set.pop(tenant, None)

    def _changed(self, quotas: Quotas, tenant: str) -> Quotas:
        changes = _remembered(self._set, tenant, lambda: self._store.quotas_set(tenant))
        return replace(quotas, **{name: value for name, value in changes.items() if name in NAMES}) if changes else quotas

    def _newest_keys(self, tenant: str) -> Quotas:
        now = time.time()
        valid = [
            key
            for key in self._store.keys(tenant)
            if key.revoked_at is None and (key.expires_at is None or key.expires_at > now)
        ]
        return max(valid, key=lambda key: key.created_at).quotas if valid else self._default


def _remembered(known: dict[str, tuple[float, Any]], tenant: str, read: Callable[[], Any]) -> Any:
    seen = known.get(tenant)
    if seen is not None and time.monotonic() - seen[0] < REMEMBERED_S:
        return seen[1]
    found = read()
    if len(known) >= REMEMBERED:
        known.clear()
    known[tenant] = (time.monotonic(), found)
    return found
