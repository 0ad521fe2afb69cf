"""A look at a long queue takes its time, and nobody waits for it."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from tests.service.store.world import new_job

from primray_service.jobs import Job
from primray_service.queue import estimates as module
from primray_service.queue.estimates import Positions, Rates
from primray_service.queue.order import Waiting
from primray_service.store.base import QueueNow


class LongQueue:
    """A store's: each look waits until it may go on."""

    def __init__(self, *jobs: Job) -> None:
        self.jobs = list(jobs)
        self.looks = 0
        self.may_look = threading.Event()
        self.may_look.set()

    def queue(self, most: int) -> QueueNow:
        self.looks += 1
        assert self.may_look.wait(10)
        time.sleep(0.01)
        return QueueNow([Waiting(job.id, job.tenant, job.priority, job.created_at) for job in self.jobs], [])


def places_of(store: LongQueue) -> Positions:
    return Positions(store, lambda: 1, Rates())  # type: ignore[arg-type]


def waiting(found: Any) -> int:
    return int(found["waiting"])


def test_who_asks_while_it_is_looked_at_is_told_what_was_seen_last(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LONG_S", 0.001)
    monkeypatch.setattr(module, "GOOD_FOR_S", 0.0)
    monkeypatch.setattr(module, "REST", 0.0)
    first, second = new_job(), new_job()
    store = LongQueue(first)
    places = places_of(store)
    assert waiting(places.of(first)) == 1  # the first who asks waits
    store.jobs.append(second)
    store.may_look.clear()
    began = time.monotonic()
    assert [waiting(places.of(first)) for _ in range(5)] == [1] * 5
    assert time.monotonic() - began < 5
    assert store.looks <= 2
    store.may_look.set()
    until = time.monotonic() + 60
    while waiting(places.of(second)) != 2:
        assert time.monotonic() < until
        time.sleep(0.01)


def test_a_look_that_fails_is_told_to_the_next_who_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LONG_S", 0.001)
    monkeypatch.setattr(module, "GOOD_FOR_S", 0.0)
    monkeypatch.setattr(module, "REST", 0.0)
    job = new_job()
    store = LongQueue(job)
    places = places_of(store)
    places.of(job)

    def fails(most: int) -> QueueNow:
        raise OSError("the database is gone")

    store.queue = fails  # type: ignore[method-assign]

    def asked_again_and_again() -> None:
        until = time.monotonic() + 60
        while time.monotonic() < until:
            places.of(job)
            time.sleep(0.01)

    with pytest.raises(OSError, match="gone"):
        asked_again_and_again()
