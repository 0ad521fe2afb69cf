"""Interface of executors, which the dispatcher uses; tests/service/executor/contract.py tests every implementation.

A chunk is one process's work: the check of a scene; a frame or a part of one, from its last checkpoint until it ends or
receives a yield command; or a merge of parts. Its worker sends messages (worker/protocol.py) while it runs and leaves files
in a folder. Delivery is at least once: after a server or a node died the same chunk may run twice, even at the same time;
results are adopted once (store.accept_checkpoint, accept_part).

The table of executors is by their configuration name; a module is imported when its executor is created.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

from primray.errors import SettingsError

from ..jobs import Json

Message = Mapping[str, Any]
OnMessage = Callable[[Message], None]  # called in the event loop, in order; must not block


@dataclass(frozen=True)
class Capacity:
    slots: int  # concurrent render chunks, 0 while there is nowhere to run them; checks have a slot of their own
    cores: int
    memory_bytes: int  # per chunk
    nodes: int = 1

    @property
    def threads(self) -> int:
        """Return the threads of one render chunk."""
        return max(1, self.cores // max(self.slots, 1))


@dataclass(frozen=True)
class Chunk:
    """A chunk of work. `inputs`: files by their path in the worker's read-only job folder. `group`: chunks of one group may run
    in one process, one after another; those of different groups, or of none, never do. Within a group, no two chunks leave
    outputs of the same name. `scene`: chunks of one scene, of any group, may reuse a process that has it open; a scene belongs
    to one tenant."""

    id: str
    kind: str  # "render", which includes parts, their merges and explained pixels; "check"
    command: Json  # the worker's first line: worker/protocol.py
    inputs: Mapping[str, Path] = field(default_factory=dict)
    # folders whose files are all inputs, by their path in the job folder
    folders: Mapping[str, Path] = field(default_factory=dict)
    load_cpu_s: float = 60.0  # CPU seconds before sampling must begin (a check: in total)
    memory_bytes: int | None = None  # None: the executor's
    group: str = ""
    more_follow: bool = False  # more chunks of the group may follow
    scene: str = ""
    roots: tuple[str, ...] = ()  # folders of shared storage, at their own paths, that its process may read
    keep_s: float = 0.0  # how long a process with the scene open may wait for another chunk of it


@dataclass(frozen=True)
class Ended:
    """End of a chunk; its process is gone, or waits for another chunk of the group (`lives`): then its files may still change,
    and its peak use covers all its chunks so far. Its files are in `folder` until `Handle.release()`."""

    reason: (
        str  # "exited", "signal", "memory-limit", "time-limit", "storage-limit", "killed" (by Handle.kill), "lost" (its node),
        # "withdrawn" (it and earlier parts of its frame cannot be trusted)
    )
    exit_code: int | None
    signal: int | None
    folder: Path
    cpu_s: float
    peak_rss_bytes: int
    log: str  # tail of its stderr
    log_file: Path | None = None  # all of the log that was kept, until `Handle.release()`
    protocol_error: str = ""  # what was wrong with its messages or files, if it was ended for that
    lives: bool = False


class Handle(Protocol):
    """A running chunk."""

    @property
    def folder(self) -> Path:
        """Return the folder where the worker's files appear while it runs."""

    async def result(self) -> Ended:
        """Wait until its process is gone, or waits for another chunk; never raises for what the process did."""

    def tell(self, command: Json) -> None:
        """Send a later command: stop, yield or preview. Has no effect if the process is gone."""

    def kill(self) -> None:
        """End it now."""

    def release(self) -> None:
        """Release its files, which are no longer needed."""


class Executor(Protocol):
    def capacity(self) -> Capacity: ...

    async def start(self) -> None:
        """Get ready; raises Problem("unavailable") with the reason if no chunk could run."""

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        """Run a chunk now; the caller respects `capacity()`."""

    def health(self) -> Json:
        """Return the state for /readyz: {"ok": bool, "sandbox": {layer: "on" | "off: why"}, ...}."""

    async def close(self) -> None:
        """End every chunk and wait for their processes."""


DEFAULT_EXECUTOR = "local"
# "module:function" beside this file; the function makes an executor from a ServeConfig and a DataDirectory.
EXECUTORS: Mapping[str, str] = {
    "local": "local:local_executor",
    "ray": "ray.executor:ray_executor",
}


def check_executor_name(name: str) -> None:
    if name not in EXECUTORS:
        raise SettingsError(f"there is no executor {name!r}; there are: {', '.join(EXECUTORS)}", code="executor")


def executor_maker(name: str) -> Callable[..., Executor]:
    module, _, function = EXECUTORS[name].partition(":")
    make: Callable[..., Executor] = getattr(import_module(f".{module}", __package__), function)
    return make


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
