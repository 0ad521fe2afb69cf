"""Where chunks run: the interface that the dispatcher uses and every executor keeps; tests/service/executor/contract.py
holds it.

A chunk is one process's work: the check of a scene; a frame, or a range of its samples, from its last checkpoint until it
ends or is told to yield; or putting such ranges together. Its worker sends messages
(worker/protocol.py) while it runs and leaves files in a folder. At-least-once: the same chunk may run twice, in parallel
even, after a server or a node died; whoever adopts results does so once (store.accept_checkpoint, accept_part).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from ..jobs import Json

Message = Mapping[str, Any]
OnMessage = Callable[[Message], None]  # called in the event loop, in order; must not block


@dataclass(frozen=True)
class Capacity:
    slots: int  # chunks of renders at a time, 0 while there is nowhere to run them; checks have a slot of their own
    cores: int
    memory_bytes: int  # of one chunk
    nodes: int = 1

    @property
    def threads(self) -> int:
        """Of one render chunk."""
        return max(1, self.cores // max(self.slots, 1))


@dataclass(frozen=True)
class Chunk:
    """`inputs`: files by the path that the worker finds them at, below its read-only job folder. `group`: chunks of one group
    may run in one process, one after another; those of different groups never do, nor those of none. Within a group, no two
    chunks leave outputs of the same name. `scene`: whose chunks may, of any group, have a process that has it open, one after
    another; it is one tenant's."""

    id: str
    kind: str  # "render", of parts and their merges too; "check"
    command: Json  # the worker's first line: worker/protocol.py
    inputs: Mapping[str, Path] = field(default_factory=dict)
    folders: Mapping[str, Path] = field(default_factory=dict)  # folders whose files are all inputs, by the path to find them at
    load_cpu_s: float = 60.0  # CPU seconds before the message that sampling has begun (a check: in all)
    memory_bytes: int | None = None  # None: the executor's
    group: str = ""
    more_follow: bool = False  # of the group, maybe
    scene: str = ""
    roots: tuple[str, ...] = ()  # folders of shared storage that its process may read, where they are
    keep_s: float = 0.0  # how long a process may wait, with the scene open, for more of the scene


@dataclass(frozen=True)
class Ended:
    """How a chunk's process ended, or that it waits for another chunk of the group (`lives`): then its files may change still,
    and what it used most is of all its chunks so far. Its files are in `folder` until `Handle.release()`."""

    reason: (
        str  # "exited", "signal", "memory-limit", "time-limit", "storage-limit", "killed" (by Handle.kill), "lost" (its node)
    )
    exit_code: int | None
    signal: int | None
    folder: Path
    cpu_s: float
    peak_rss_bytes: int
    log: str  # the tail of what it printed to stderr
    log_file: Path | None = None  # all of it that was kept, until `Handle.release()`
    protocol_error: str = ""  # what was wrong with its messages or its files, where it was ended for that
    lives: bool = False


class Handle(Protocol):
    """A chunk that runs."""

    @property
    def folder(self) -> Path:
        """Where the worker's files appear while it runs."""

    async def result(self) -> Ended:
        """When its process is gone, or waits for another chunk; never raises for what the process did."""

    def tell(self, command: Json) -> None:
        """Send a later line: stop, yield or preview. Nothing happens if it is gone."""

    def kill(self) -> None:
        """End it now."""

    def release(self) -> None:
        """Its files are not needed any more."""


class Executor(Protocol):
    def capacity(self) -> Capacity: ...

    async def start(self) -> None:
        """Get ready; raises Problem("unavailable") where no chunk could run, saying why."""

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        """Run a chunk now; the caller keeps to `capacity()`."""

    def health(self) -> Json:
        """For /readyz: {"ok": bool, "sandbox": {layer: "on" | "off: why"}, ...}."""

    async def close(self) -> None:
        """End every chunk and wait for their processes."""
