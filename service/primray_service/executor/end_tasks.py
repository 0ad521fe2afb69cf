"""Cancellation of asyncio tasks."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from typing import Any

AGAIN_AFTER_S = 1.0


async def end_tasks(tasks: Collection[asyncio.Task[Any]]) -> None:
    """Cancel the tasks until none runs.

    Once is not enough: before Python 3.12, asyncio.wait_for swallows a cancellation that arrives at the moment its awaitable
    completes, and a task that calls it repeatedly would run for ever.
    """
    left = {task for task in tasks if not task.done()}
    while left:
        for task in left:
            task.cancel()
        _, left = await asyncio.wait(left, timeout=AGAIN_AFTER_S)
