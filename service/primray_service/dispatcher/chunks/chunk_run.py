"""A running chunk: its process, its messages and the commands sent to it. Belongs to the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...executor.base import Chunk, Ended, Executor
from ...jobs import Json
from ..context import Context
from . import adoption
from .messages import Checkpoint, Inbox, NotBelieved

LEAVE_S = 0.3  # grace period for a worker to exit after its last message
STAY_S = 2.0  # grace period to get ready for the next chunk, which takes less than starting another worker
PREVIEW_EVERY_S = 3.0


class ChunkRun:
    """A running chunk; `killed_for` is why the dispatcher killed it, "" if it did not."""

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
        """Return whether all messages have been received."""
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
        """Wait until a message comes, or for `timeout_s` seconds."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._news.wait(), timeout_s)
        self._news.clear()

    def tell(self, does: str) -> None:
        self.handle.tell({"do": does})

    def tell_to_end(self, does: str, grace_s: float, why: str) -> None:
        """Tell the worker to stop or yield, and kill it if it is still there after the grace period."""
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

    def distrust(self) -> None:
        """Kill the chunk for what it left, also if it has reported its end by now: nothing of it is adopted."""
        self.killed_for = "not-believed"
        self.handle.kill()

    def ask_preview(self) -> None:
        if self._loop.time() - self._preview_at >= PREVIEW_EVERY_S:
            self._preview_at = self._loop.time()
            self.tell("preview")

    async def ended(self) -> Ended:
        """Return how the chunk ended, after its last message or its death; its process is gone then."""
        if not self._ending.done():
            await asyncio.wait([self._ending], timeout=STAY_S if self.chunk.more_follow or self.chunk.keep_s else LEAVE_S)
            self.handle.kill()  # nothing that it still does is needed
        return await asyncio.shield(self._ending)

    def release(self) -> None:
        """Release the folder of the chunk, since its files have been taken."""
        if self._ending.done() and not self._released:
            self._released = True
            self.handle.release()

    async def close(self) -> None:
        """End the process and remove its files."""
        if self._timer is not None:
            self._timer.cancel()
        if not self._ending.done():
            self.handle.kill()
            await asyncio.wait([self._ending])
        self.release()


async def adopt_checkpoint_of(run: ChunkRun, message: Checkpoint, target: Path, context: Context) -> bool:
    """Adopt the file of a checkpoint that a chunk reports, and return whether that was possible. A chunk whose file is not as
    reported is distrusted, and one for whose file the disk has no room is killed."""
    source = run.handle.folder / message.file
    try:
        await context.calls.disk(adoption.adopt_checkpoint, context.data, source, target, context.limits.output_bytes)
    except adoption.NotAdopted:
        run.distrust()
    except OSError:
        context.disk_is_full = True
        run.kill("storage")
    else:
        return True
    return False
