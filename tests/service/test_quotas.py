"""Buckets of requests: how they fill, and that they are not kept for ever."""

from __future__ import annotations

from typing import Any

from primray_service.limits import Quotas
from primray_service.quotas import RequestRates


def test_a_bucket_fills_at_its_rate_and_no_further() -> None:
    now = 0.0
    rates = RequestRates(lambda: now)
    quotas = Quotas(requests_per_s=2.0, burst=3)

    def take() -> Any:
        return rates.take("key", quotas)

    assert [take().is_allowed for _ in range(4)] == [True, True, True, False]
    refused = take()
    assert (refused.remaining, refused.retry_after_s, refused.reset_s) == (0, 1, 2)
    now = 0.5
    assert [take().is_allowed for _ in range(2)] == [True, False]
    now = 100.0
    assert [take().is_allowed for _ in range(4)] == [True, True, True, False]
    assert rates.take("another", quotas).is_allowed  # type: ignore[union-attr]
    assert rates.take("key", Quotas(requests_per_s=None)) is None


def test_buckets_do_not_grow_without_end() -> None:
    now = 0.0
    rates = RequestRates(lambda: now)
    for number in range(25_000):
        now += 0.01
        rates.take(f"key {number}", Quotas(requests_per_s=50.0, burst=2))
    assert len(rates._buckets) <= 10_001
