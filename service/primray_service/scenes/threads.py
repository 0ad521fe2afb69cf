"""Blocking work beside the event loop that is always waited for: files must not be closed or removed while a thread uses
them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


async def to_the_end(function: Callable[[], T]) -> T:
    """Run a function like asyncio.to_thread, but wait for the thread even if cancelled, and only then propagate the
    cancellation."""
    running = asyncio.ensure_future(asyncio.to_thread(function))
    cancelled: asyncio.CancelledError | None = None
    while not running.done():
        try:
            await asyncio.wait([running])
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        running.exception()  # retrieved, so that it is not reported as lost
        raise cancelled
    return running.result()
