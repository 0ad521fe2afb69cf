"""A server whose clock is wrong takes nobody's lease away, and is not kept from one."""

from __future__ import annotations

import asyncio
import time

import pytest

from primray_service.dispatcher.lease import Lease
from primray_service.store import open_store

from ..postgres import postgres_databases, postgres_server, postgres_url

__all__ = ["postgres_databases", "postgres_server", "postgres_url"]


@pytest.mark.parametrize("wrong_by_s", [3600.0, -3600.0])
def test_the_databases_clock_counts(postgres_url: str, monkeypatch: pytest.MonkeyPatch, wrong_by_s: float) -> None:
    store = open_store(postgres_url)
    real = time.time

    async def play() -> None:
        first, second = Lease(store, "first", lambda: {"slots": 1}), Lease(store, "second")
        assert await first.acquire()
        monkeypatch.setattr(time, "time", lambda: real() + wrong_by_s)
        assert not await second.acquire()
        leader = store.leader()
        assert leader is not None
        assert (leader.holder, leader.about) == ("first", {"slots": 1})
        assert 0 < leader.expires_in_s <= 5
        await first.release()
        assert store.leader() is None
        assert await second.acquire()
        monkeypatch.setattr(time, "time", real)
        assert not await first.acquire()
        for lease in (first, second):
            lease.close()

    asyncio.run(play())
    store.close()
