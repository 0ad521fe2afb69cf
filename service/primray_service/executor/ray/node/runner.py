"""A LocalExecutor in a thread of its own: one for all chunks that this Ray process is given, one after another, so that the
next one finds a warm worker, or one that has its stage open."""

from __future__ import annotations

import asyncio
import queue
import threading
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from ....files import DataDirectory
from ....jobs import Json
from ....limits import Limits
from ...base import Chunk, Ended, Handle
from ...local import LocalExecutor

T = TypeVar("T")
News = Mapping[str, Any] | Ended


class Runner:
    def __init__(self, data: DataDirectory, limits: Limits, cores: int) -> None:
        self._loop = asyncio.new_event_loop()
        # Workers die with the thread that started them: this one lives as long as the process.
        threading.Thread(target=self._loop.run_forever, name="runner", daemon=True).start()
        self._executor = LocalExecutor(data, limits, slots=1, cores=cores)
        self.call(self._executor.open)

    def call(self, work: Callable[[], T]) -> T:
        """Call the function in that thread, and wait for it."""

        async def done() -> T:
            return work()

        return asyncio.run_coroutine_threadsafe(done(), self._loop).result()

    def begin(self, chunk: Chunk) -> Running:
        return Running(self, chunk)

    def submit(self, chunk: Chunk, news: queue.SimpleQueue[News]) -> Handle:
        """Submit a chunk; must be called in that thread."""
        handle = self._executor.submit(chunk, news.put)
        asyncio.ensure_future(handle.result()).add_done_callback(lambda ended: news.put(ended.result()))
        return handle

    def close(self) -> None:
        asyncio.run_coroutine_threadsafe(self._executor.close(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)


class Running:
    """A running chunk; its methods are thread-safe."""

    def __init__(self, runner: Runner, chunk: Chunk) -> None:
        self._runner = runner
        self.news: queue.SimpleQueue[News] = queue.SimpleQueue()
        self._handle = runner.call(lambda: runner.submit(chunk, self.news))
        self.folder = self._handle.folder

    def heed(self, command: Json) -> None:
        if command["do"] == "kill":
            self._runner.call(self._handle.kill)
        else:
            self._runner.call(lambda: self._handle.tell(command))

    def release(self) -> None:
        self._runner.call(self._handle.kill)  # has no effect if it has ended
        self._runner.call(self._handle.release)
