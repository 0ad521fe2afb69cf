"""A chunk on a node: its files come, its worker runs in the same sandbox as on one machine, its messages and files go back.

A LocalExecutor in a thread of its own runs all chunks that this Ray process is given, one after another, so that the next one
finds a warm worker, or one that has its stage open. Ray's process is trusted as the server is; the worker is not, so nothing
of a scene is opened here.
"""

from __future__ import annotations

import asyncio
import hashlib
import os
import queue
import stat
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ....files import DataDirectory
from ....jobs import Json
from ....limits import Limits
from ...base import Chunk, Ended, Handle
from ...local import LocalExecutor
from .cache import NodeCache, Read, node_folder
from .fitness import fitness
from .transfer import PART_BYTES, Begun, End, FileEnd, Item, Message, Order, Part, Refused

Take = Callable[[], list[Json] | None]  # returns the mailbox's commands for the chunk; None: it is over


@dataclass
class _Process:
    """A Ray process, which may get one chunk after another."""

    made_for: tuple[Json, int] | None = None
    runner: Runner | None = None


_process = _Process()


def run(order: Order, node: str, read: Read, take: Take) -> Iterator[list[Item]]:
    """Run a chunk. `read` and `take` ask Ray; they are called in other threads, since a blocked Ray call in this one would
    release its cores."""
    found = fitness(order.wanted)
    if found.why:
        yield [Refused(node, found.why)]
        return
    with ThreadPoolExecutor(1) as fetching, ExitStack() as stack:
        chunk, begun = fetching.submit(_fetched, order, node, read, stack).result()
        yield [begun]
        running = _runner(order).begin(chunk)
        stack.callback(running.release)
        threading.Thread(target=_listen, args=(running, take), name="mailbox", daemon=True).start()
        yield from _items_of(running, Limits(**order.limits).output_bytes)


def _fetched(order: Order, node: str, read: Read, stack: ExitStack) -> tuple[Chunk, Begun]:
    """Fetch the chunk's files to this node, and hold them until the stack is closed."""
    cache = NodeCache(node_folder() / "cache")
    new: list[int] = []
    paths: dict[str, Path] = {}
    for name, content in {**order.inputs, **order.folders}.items():
        held = cache.hold(content, read)
        stack.callback(held.release)
        paths[name] = held.path
        new += [] if held.was_there else [content.bytes]
    about = order.chunk
    chunk = Chunk(
        order.key,
        about["kind"],
        about["command"],
        {name: paths[name] for name in order.inputs},
        {name: paths[name] for name in order.folders},
        load_cpu_s=about["load_cpu_s"],
        memory_bytes=about["memory_bytes"],
        group=about["group"],
        more_follow=about["more_follow"],
        scene=about["scene"],
        keep_s=about["keep_s"],
    )
    return chunk, Begun(node, len(new), sum(new))


def _runner(order: Order) -> Runner:
    made_for = (order.limits, order.cores)
    if _process.runner is None or _process.made_for != made_for:
        if _process.runner is not None:
            _process.runner.close()
        _process.runner = Runner(DataDirectory(node_folder()), Limits(**order.limits), order.cores)
        _process.made_for = made_for
    return _process.runner


def _listen(running: Running, take: Take) -> None:
    while (commands := take()) is not None:
        for command in commands:
            running.heed(command)


def _items_of(running: Running, most_bytes: int) -> Iterator[list[Item]]:
    """Yield items until the chunk ends."""
    while True:
        news = running.news.get()
        if isinstance(news, Ended):
            yield [_end(news)]
            return
        left = most_bytes
        ahead: list[Item] = []
        for name in files_of(news):
            for item in taken(running.folder, name, left):
                ahead.append(item)
                if size := len(getattr(item, "data", b"")):
                    left -= size
                    yield ahead
                    ahead = []
        yield [*ahead, Message(dict(news))]


def _end(ended: Ended) -> End:
    log = ended.log_file.read_bytes() if ended.log_file is not None and ended.log_file.is_file() else ended.log.encode()
    about = {name: getattr(ended, name) for name in ("reason", "exit_code", "cpu_s", "peak_rss_bytes", "log", "protocol_error")}
    return End({**about, "signal": None if ended.signal is None else int(ended.signal)}, log)


def files_of(message: Mapping[str, Any]) -> list[str]:
    """Return the files that a message names."""
    if message["at"] in ("preview", "checkpoint"):
        return [message["file"]]
    return [output["file"] for output in message["outputs"]] if message["at"] == "done" else []


def taken(folder: Path, name: str, most_bytes: int) -> Iterator[Part | FileEnd]:
    """Yield the file's blocks; nothing unless it is a plain file of at most `most_bytes`: its adoption then fails with a
    report."""
    try:
        handle = os.open(folder / name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode) or found.st_nlink != 1 or found.st_size > most_bytes:
            return
        sha256, left = hashlib.sha256(), found.st_size  # bytes appended meanwhile are not taken
        while left > 0 and (data := file.read(min(left, PART_BYTES))):
            left -= len(data)
            sha256.update(data)
            yield Part(name, data)
        if not found.st_size:
            yield Part(name, b"")
    with suppress(OSError):
        os.unlink(folder / name)
    yield FileEnd(name, sha256.hexdigest())


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
