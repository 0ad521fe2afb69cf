"""Tasks end, also those that swallow a cancellation."""

from __future__ import annotations

import asyncio

import pytest

from primray_service.executor import base as module
from primray_service.executor.base import end_tasks


def test_a_task_that_swallows_cancellations_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """As one does that is in asyncio.wait_for, and what it waits for is done in that moment."""
    monkeypatch.setattr(module, "AGAIN_AFTER_S", 0.01)
    swallowed = []

    async def stubborn() -> None:
        while True:
            try:
                await asyncio.sleep(60)
            except asyncio.CancelledError:
                swallowed.append(1)
                if len(swallowed) > 2:
                    raise

    async def act() -> None:
        tasks = [asyncio.create_task(stubborn()), asyncio.create_task(asyncio.sleep(0))]
        await asyncio.sleep(0.01)
        await end_tasks(tasks)
        assert all(task.done() for task in tasks)
        await end_tasks(tasks)
        await end_tasks([])

    asyncio.run(asyncio.wait_for(act(), 10))
    assert len(swallowed) == 3
