"""What is said to a chunk reaches it in order; who asks for one that is over is told so."""

from __future__ import annotations

import asyncio

import pytest

from primray_service.executor.ray.node import tasks
from primray_service.executor.ray.node.tasks import Mailbox


def test_letters_come_in_order_whenever_they_were_sent() -> None:
    async def go() -> None:
        box = Mailbox()
        await box.put("a", {"do": "preview"})
        await box.put("b", {"do": "stop"})
        await box.put("a", {"do": "yield"})
        assert await box.take("a") == [{"do": "preview"}, {"do": "yield"}]
        waiting = asyncio.create_task(box.take("a"))
        await asyncio.sleep(0)
        await box.put("a", {"do": "kill"})
        assert await waiting == [{"do": "kill"}]

    asyncio.run(go())


@pytest.mark.parametrize("asks", ["before", "after"])
def test_a_chunk_that_is_over(asks: str) -> None:
    async def go() -> None:
        box = Mailbox()
        asking = asyncio.create_task(box.take("a")) if asks == "before" else None
        await asyncio.sleep(0)
        await box.forget("a")
        await box.put("a", {"do": "stop"})
        assert await (asking or box.take("a")) is None

    asyncio.run(go())


def test_nobody_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "ANSWER_AFTER_S", 0.01)
    assert asyncio.run(Mailbox().take("a")) == []


def test_only_so_many_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "MOST_OVER", 2)

    async def go() -> None:
        box = Mailbox()
        for key in "abc":
            await box.forget(key)
        assert len(box._over) == 2
        assert await box.take("c") is None

    asyncio.run(go())


def test_it_knows_what_runs() -> None:
    async def go() -> None:
        box = Mailbox()
        await box.began("a", {"name": "shot"})
        await box.began("b", {"name": "other"})
        await box.forget("a")
        await box.began("a", {"name": "too late"})
        assert await box.running() == [{"name": "other"}]

    asyncio.run(go())
