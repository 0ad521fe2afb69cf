"""Commands from the server to running chunks: an actor beside the driver, which a task polls with a blocking call.

It also knows what runs where, for those who ask about the cluster.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from contextlib import suppress

from ....jobs import Json

ANSWER_AFTER_S = 20.0  # at the latest
MOST_OVER = 10_000  # ended chunks that are remembered


class Mailbox:
    """Mailbox of one driver. All methods run in one event loop."""

    def __init__(self) -> None:
        self._letters: dict[str, list[Json]] = defaultdict(list)
        self._news: dict[str, asyncio.Event] = defaultdict(asyncio.Event)
        self._over: dict[str, None] = {}  # in the order in which they ended
        self._running: dict[str, Json] = {}

    async def put(self, key: str, command: Json) -> None:
        if key not in self._over:
            self._letters[key].append(command)
            self._news[key].set()

    async def take(self, key: str) -> list[Json] | None:
        """Return new commands, maybe none. None: the chunk is over."""
        if key not in self._over:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._news[key].wait(), ANSWER_AFTER_S)
        if key in self._over:
            return None
        self._news[key].clear()
        return self._letters.pop(key, [])

    async def began(self, key: str, about: Json) -> None:
        """Record that a node has the chunk."""
        if key not in self._over:
            self._running[key] = about

    async def running(self) -> list[Json]:
        return list(self._running.values())

    async def forget(self, key: str) -> None:
        """Record that the chunk is over."""
        self._over[key] = None
        self._running.pop(key, None)
        while len(self._over) > MOST_OVER:
            del self._over[next(iter(self._over))]
        self._letters.pop(key, None)
        if key in self._news:
            self._news.pop(key).set()
