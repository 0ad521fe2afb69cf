"""A worker on this machine: a process with a private folder, which waits for a chunk, and maybe for more of the same group."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..limits import Limits
from ..sandbox import Budget, worker_spawn
from ..sandbox.spawn import WORKER
from .base import Chunk
from .process import WorkerProcess
from .slots import Slot, fill, take_out

KINDS = ("render", "check")
READY = b'{"at": "ready"}'


@dataclass(frozen=True)
class SandboxLayers:
    """Start options of workers: `layers` of the sandbox (None: all available ones), and their program."""

    layers: frozenset[str] | None = None
    program: Sequence[str] = WORKER


class Worker:
    """A worker; `group`: that of its last chunks, "" before the first; `scene`: the open scene, the same for all its chunks."""

    def __init__(
        self,
        kind: str,
        slot: Slot,
        memory_bytes: int,
        threads: int,
        limits: Limits,
        sandbox_layers: SandboxLayers,
        roots: tuple[str, ...] = (),
    ) -> None:
        self.slot = slot
        self.roots = roots
        self.memory_bytes = memory_bytes
        self.group = self.scene = ""
        self.keep_s = 0.0
        self.chunks = 0  # number of chunks it was given
        self._released = 0  # number of those whose files were released
        self._leaves_others = False  # files of another group are in its output folder
        self._logs = 0
        self._inputs: Mapping[str, Path] = {}
        self._folders: Mapping[str, Path] = {}
        budget = Budget(memory_bytes, threads, limits.output_bytes)
        spawn = worker_spawn(slot.root, budget, (*sandbox_layers.program, kind), sandbox_layers.layers, roots)
        self.wrapped = spawn.wrapped
        self.ready = asyncio.Event()  # once for all its chunks
        self.process = WorkerProcess(spawn, slot.log, limits.log_bytes, self._on_line)

    def _on_line(self, line: bytes) -> None:
        """Ignore lines before the first chunk; its earlier output does not belong to a chunk's log."""
        if line == READY:
            self.is_ready()

    def is_ready(self) -> None:
        self.ready.set()
        self.process.begin_log()

    async def is_ready_within(self, seconds: float) -> bool:
        """Return whether it is ready, or has ended, within that time."""
        waited: set[asyncio.Future[Any]] = {asyncio.ensure_future(self.ready.wait()), self.process.exit}
        await asyncio.wait(waited, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
        for future in waited - {self.process.exit}:
            future.cancel()
        return self.ready.is_set()

    def may_have(self, chunk: Chunk) -> bool:
        """Return whether the worker may run the chunk: it is of the same group; or the worker has the same scene open, and
        earlier files were released."""
        if chunk.group and self.group == chunk.group:
            return True
        return bool(chunk.scene) and self.scene == chunk.scene and self._released == self.chunks

    def begin(self, chunk: Chunk) -> None:
        """Assign the worker to this chunk."""
        self._leaves_others = self.chunks > 0 and not (chunk.group and self.group == chunk.group)
        self.group, self.scene, self.keep_s = chunk.group, chunk.scene, chunk.keep_s
        self.chunks += 1

    def put_files(self, chunk: Chunk) -> None:
        """Link the chunk's files that are not there yet, and remove those of earlier chunks and of other jobs; blocks."""
        if self._leaves_others:
            take_out(self.slot.out, [path.name for path in self.slot.out.iterdir() if path.is_file()])
        take_out(self.slot.job, [name for name, path in self._inputs.items() if chunk.inputs.get(name) != path])
        inputs = {name: path for name, path in chunk.inputs.items() if self._inputs.get(name) != path}
        folders = {name: path for name, path in chunk.folders.items() if self._folders.get(name) != path}
        self._inputs, self._folders = dict(chunk.inputs), {**self._folders, **chunk.folders}
        fill(self.slot.job, inputs, folders)

    def next_log(self) -> Path:
        """Return the log so far, which is complete; later output goes into another file."""
        self._logs += 1
        return self.process.change_log(self.slot.root / f"log-{self._logs}.txt")

    def release(self) -> None:
        """Record that the files of one of its chunks were released."""
        self._released += 1
        self.remove_if_over()

    def remove_if_over(self) -> None:
        if self._released == self.chunks and self.process.exit.done():
            asyncio.get_running_loop().run_in_executor(None, self.slot.remove)
