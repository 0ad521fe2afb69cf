"""One chunk while it runs: its process, what has come from it, and what it is told. Belongs to the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from ...executor.base import Chunk, Ended, Executor
from ...jobs import Json
from .inbox import Inbox
from .messages import NotBelieved

LEAVE_S = 0.3  # a worker that has said its last word may end by itself for so long
STAY_S = 2.0  # or get ready for the next frame, which takes less than starting another
PREVIEW_EVERY_S = 3.0


class ChunkRun:
    """`killed_for`: why it was killed by us, "" if it was not."""

    def __init__(self, executor: Executor, chunk: Chunk, convergence: list[Json]) -> None:
        self._loop = asyncio.get_running_loop()
        self.chunk = chunk
        self.inbox = Inbox(self._loop.time(), convergence)
        self.killed_for = ""
        self._news = asyncio.Event()
        self._released = False
        self._timer: asyncio.TimerHandle | None = None
        self._preview_at = -PREVIEW_EVERY_S
        self.handle = executor.submit(chunk, self._on_message)
        self._ending = asyncio.create_task(self.handle.result())
        self._ending.add_done_callback(lambda _: self._news.set())

    @property
    def is_over(self) -> bool:
        """Nothing more will come from it."""
        return self._ending.done() or self.inbox.last is not None

    @property
    def sampled_s(self) -> float:
        since = self.inbox.sampling_since
        return 0.0 if since is None else self._loop.time() - since

    @property
    def silent_s(self) -> float:
        return self._loop.time() - self.inbox.heard_at

    def _on_message(self, message: Mapping[str, Any]) -> None:
        try:
            self.inbox.put(message, self._loop.time())
        except NotBelieved:
            self.kill("not-believed")
        self._news.set()

    async def news(self, timeout_s: float) -> None:
        """Until something came, or so many seconds."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._news.wait(), timeout_s)
        self._news.clear()

    def tell(self, does: str) -> None:
        self.handle.tell({"do": does})

    def tell_to_end(self, does: str, grace_s: float, why: str) -> None:
        """Stop or yield; killed if it is still there after so long."""
        self.tell(does)
        self.kill_in(grace_s, why)

    def kill_in(self, seconds: float, why: str) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_later(seconds, self.kill, why)

    def kill(self, why: str) -> None:
        if not self.is_over:
            self.killed_for = self.killed_for or why
        self.handle.kill()

    def ask_preview(self) -> None:
        if self._loop.time() - self._preview_at >= PREVIEW_EVERY_S:
            self._preview_at = self._loop.time()
            self.tell("preview")

    async def ended(self) -> Ended:
        """After its last word, or its death; its process is gone then."""
        if not self._ending.done():
            await asyncio.wait([self._ending], timeout=STAY_S if self.chunk.more_follow or self.chunk.keep_s else LEAVE_S)
            self.handle.kill()  # what it still does is of no use
        return await asyncio.shield(self._ending)

    def release(self) -> None:
        """What it left has been taken."""
        if self._ending.done() and not self._released:
            self._released = True
            self.handle.release()

    async def close(self) -> None:
        """Its process and its files are gone afterwards."""
        if self._timer is not None:
            self._timer.cancel()
        if not self._ending.done():
            self.handle.kill()
            await asyncio.wait([self._ending])
        self.release()
