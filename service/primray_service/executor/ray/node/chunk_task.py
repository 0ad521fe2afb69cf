"""A chunk on a node: its files come, its worker runs in the same sandbox as on one machine, its messages and files go back.

Ray's process is trusted as the server is; the worker is not, so nothing of a scene is opened here.
"""

from __future__ import annotations

import hashlib
import os
import stat
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ....files import DataDirectory
from ....jobs import Json
from ....limits import Limits
from ...base import Chunk, Ended
from .cache import NodeCache, Read, node_folder
from .fitness import fitness
from .runner import Runner, Running
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
        yield from _told(running, Limits(**order.limits).output_bytes)


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


def _told(running: Running, most_bytes: int) -> Iterator[list[Item]]:
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
    told = {name: getattr(ended, name) for name in ("reason", "exit_code", "cpu_s", "peak_rss_bytes", "log", "protocol_error")}
    return End({**told, "signal": None if ended.signal is None else int(ended.signal)}, log)


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
