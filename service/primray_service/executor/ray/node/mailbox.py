"""What the server says to chunks that run. An actor beside the driver: a task asks it, and has an answer once there is one."""

from __future__ import annotations

import asyncio
from collections import defaultdict

from ....jobs import Json

ANSWER_AFTER_S = 20.0  # at the latest


class Mailbox:
    """All methods run in one event loop."""

    def __init__(self) -> None:
        self._letters: dict[str, list[Json]] = defaultdict(list)
        self._news: dict[str, asyncio.Event] = defaultdict(asyncio.Event)
        self._over: set[str] = set()

    async def put(self, key: str, command: Json) -> None:
        self._letters[key].append(command)
        self._news[key].set()

    async def take(self, key: str) -> list[Json] | None:
        """What has come since; maybe nothing yet. None: the chunk is over."""
        try:
            await asyncio.wait_for(self._news[key].wait(), ANSWER_AFTER_S)
        except TimeoutError:
            return []
        if key in self._over:
            self._over.discard(key)
            return None
        self._news[key].clear()
        return self._letters.pop(key, [])

    async def forget(self, key: str) -> None:
        """Nobody will ask any more, but for one who asks now."""
        self._letters.pop(key, None)
        if key in self._news:
            self._over.add(key)
            self._news.pop(key).set()

    async def is_there(self) -> bool:
        return True
