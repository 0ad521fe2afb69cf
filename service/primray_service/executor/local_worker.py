"""A worker on this machine, and one chunk's life in it.

A worker is a process with a private folder, which waits for a chunk, and maybe for more of the same group. A chunk's files
are linked into the folder, the process is watched, and its end is reported. Lines from a worker are untrusted: they are
bounded, and refused unless they are messages (worker/protocol.py).
"""

from __future__ import annotations

import asyncio
import json
import logging
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..jobs import Json
from ..limits import Limits
from ..sandbox import Budget, decode_exit, worker_spawn
from ..sandbox.spawn import WORKER, worker_fork
from ..worker.protocol import LAST, BadMessage, parse
from . import process
from .base import Chunk, Ended, OnMessage
from .fork_server import ForkServer
from .process import Exit, StartedProcess, WorkerProcess
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
        fork_server: ForkServer | None = None,
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
        self.ready = asyncio.Event()  # once for all its chunks
        self.wrapped = False  # whether its exit code is bubblewrap's
        self.process: WorkerProcess
        if fork_server is not None:
            request = worker_fork(slot.root, budget, sandbox_layers.layers, roots)
            self.process = fork_server.fork(kind, request, slot.log, limits.log_bytes, self._on_line)
        else:
            spawn = worker_spawn(slot.root, budget, (*sandbox_layers.program, kind), sandbox_layers.layers, roots)
            self.wrapped = spawn.wrapped
            self.process = StartedProcess(spawn, slot.log, limits.log_bytes, self._on_line)

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


LOG = logging.getLogger(__name__)

LOOK_EVERY_S = 0.15
LOOK_AT_FOLDER_EVERY_S = 0.6
LEAVE_WITHIN_S = 5.0  # after its last message
# A worker stays for the next chunk of its group if a new start's CPU second would matter, and if leftovers cannot be in the
# way: a large frame still has all of its allowed memory and disk space.
STAYS_IF_CPU_S = 20.0
STAYS_IF_PART = 0.25
# The wall-clock limit is the last resort for a worker that sleeps: others may have the CPU.
LOAD_WALL_PER_CPU = 20.0
SIGNALS = {signal.SIGXCPU: "time-limit", signal.SIGXFSZ: "storage-limit"}


class Run:
    """Handle of a chunk. `on_stay` gets a worker that has ended the chunk and can take another of the same group."""

    def __init__(
        self,
        chunk: Chunk,
        worker: Worker,
        on_message: OnMessage,
        limits: Limits,
        threads: int,
        on_stay: Callable[[Worker], None],
    ) -> None:
        self.chunk = chunk
        self.ended: asyncio.Future[Ended] = asyncio.get_running_loop().create_future()
        self._worker = worker
        self._process = worker.process
        self._on_message = on_message
        self._on_stay = on_stay
        self._may_stay = (bool(chunk.group) and chunk.more_follow) or (bool(chunk.scene) and chunk.keep_s > 0)
        self._limits = limits
        self._memory_bytes = min(chunk.memory_bytes or limits.memory_bytes, worker.memory_bytes)
        self._command = self._completed(chunk.command, threads)
        self._unsent: list[bytes] | None = []  # until its first command is sent
        self._reason = ""
        self._said = ""  # what was wrong with its messages
        self._last = ""
        self._sampling = False
        self._released = False
        self._used = self._process.used()
        self._cpu_before_s = self._used.cpu_s
        self._peak_bytes = 0
        worker.begin(chunk)
        self._process.on_line = self._on_line
        self._process.exit.add_done_callback(self._on_exit)
        self._work = asyncio.ensure_future(self._run())

    @property
    def pid(self) -> int:
        """Return the pid of its process (WorkerProcess.pid); a sandbox's processes may be around the worker."""
        return self._process.pid

    @property
    def folder(self) -> Path:
        return self._worker.slot.out

    async def result(self) -> Ended:
        return await asyncio.shield(self.ended)

    def tell(self, command: Json) -> None:
        if self._last:  # or the next chunk would receive it
            return
        line = json.dumps(command).encode() + b"\n"
        if self._unsent is not None:
            self._unsent.append(line)
        else:
            self._process.write(line)

    def kill(self) -> None:
        self._kill("killed")

    def release(self) -> None:
        if not self._released:
            self._released = True
            if self.ended.done():
                self._remove()

    def _completed(self, command: Json, threads: int) -> bytes:
        """Return the command with the settings that this machine decides if the chunk leaves them open."""
        limits = {
            "output_bytes": self._limits.output_bytes,
            "log_bytes": self._limits.log_bytes,
            **(command.get("limits") or {}),
        }
        limits |= {"memory_bytes": self._memory_bytes, "load_cpu_s": self.chunk.load_cpu_s}
        completed = {**command, "limits": limits, "stay": self._may_stay}
        if "settings" in command and command["settings"].get("threads") is None:
            completed["settings"] = {**command["settings"], "threads": threads}
        return json.dumps(completed).encode()

    async def _run(self) -> None:
        try:
            await asyncio.to_thread(self._worker.put_files, self.chunk)
        except (OSError, ValueError) as error:
            LOG.error("the files of %s cannot be linked into its folder: %s", self.chunk.id, error)
            self._said = f"its files cannot be linked into its folder: {error}"
            self._kill("lost")
            return
        sending = asyncio.ensure_future(self._send())
        try:
            await self._watch()
        finally:
            sending.cancel()

    async def _send(self) -> None:
        """Send the command once the worker is ready; its log begins then."""
        await self._worker.ready.wait()
        unsent, self._unsent = self._unsent or [], None
        self._process.write(self._command + b"\n" + b"".join(unsent))

    async def _watch(self) -> None:
        start = time.monotonic()
        load_wall_s = LOAD_WALL_PER_CPU * self.chunk.load_cpu_s
        next_folder = start
        while not self._process.exit.done() and not self.ended.done():
            self._look()
            now = time.monotonic()
            if now >= next_folder:
                next_folder = now + LOOK_AT_FOLDER_EVERY_S
                if process.folder_bytes(self.folder, self._limits.output_bytes) > self._limits.output_bytes:
                    self._kill("storage-limit")
            if now - start > load_wall_s + (2 * self._limits.seconds if self._sampling else 0):
                self._kill("time-limit")
            await asyncio.wait({self._process.exit}, timeout=LOOK_EVERY_S)

    def _look(self) -> None:
        used = self._process.used()
        if used.cpu_s < self._used.cpu_s:
            return  # it has just ended, or only the sandbox's processes are left
        self._used = used
        self._peak_bytes = max(self._peak_bytes, used.rss_bytes, self._process.peak_rss_bytes())
        if used.rss_bytes > self._memory_bytes:
            self._kill("memory-limit")
        elif not self._sampling and used.cpu_s - self._cpu_before_s > self.chunk.load_cpu_s:
            self._kill("time-limit")

    def _on_line(self, line: bytes) -> None:
        if self._reason:
            return  # messages after its end do not count
        try:
            message = parse(line)
            if self._last == "done" and self._may_stay and message["at"] == "ready":
                self._stay()
                return
            if self._last:
                raise BadMessage(f"a message after {self._last!r}")
        except BadMessage as error:
            self._said = f"the worker sent {error}"
            self._kill("exited")
            return
        at = message["at"]
        if at == "ready":
            self._worker.is_ready()
            return
        if at == "phase" and message["phase"] == "sampling":
            self._sampling = True
        if at in LAST:
            self._last = at
            self._look()  # for its total usage
            asyncio.get_running_loop().call_later(LEAVE_WITHIN_S, self._should_be_gone)
        try:
            self._on_message(message)
        except Exception:
            LOG.exception("a message %r of %s could not be processed", at, self.chunk.id)

    def _should_be_gone(self) -> None:
        if not self.ended.done():
            self._said = f"the worker did not exit after {self._last!r}"
            self._kill("exited")

    def _kill(self, reason: str) -> None:
        if not self.ended.done() and not self._process.exit.done():
            self._reason = self._reason or reason
            self._process.kill(gently=True)

    def _stay(self) -> None:
        self._look()
        cpu_s = self._used.cpu_s - self._cpu_before_s
        left = process.folder_bytes(self.folder, self._limits.output_bytes)
        if (
            (cpu_s > STAYS_IF_CPU_S and not self.chunk.keep_s)
            or self._used.rss_bytes > STAYS_IF_PART * self._memory_bytes
            or left > STAYS_IF_PART * self._limits.output_bytes
        ):
            self._kill("exited")
            return
        self._process.exit.remove_done_callback(self._on_exit)
        tail, log_file = self._process.log.tail(), self._worker.next_log()
        self._end(
            Ended(
                reason="exited",
                exit_code=0,
                signal=None,
                folder=self.folder,
                cpu_s=max(cpu_s, 0.0),
                peak_rss_bytes=self._peak_bytes,
                log=tail,
                log_file=log_file,
                lives=True,
            )
        )
        self._on_stay(self._worker)

    def _on_exit(self, found: asyncio.Future[Exit]) -> None:
        end = found.result()
        code, number = decode_exit(end.returncode, self._worker.wrapped)
        how = "exited" if number is None else SIGNALS.get(signal.Signals(number), "signal")
        reason = self._reason or ("lost" if end.lost else how)
        peak = max(self._peak_bytes, end.max_rss_bytes)
        cpu_s = max(end.cpu_s, self._used.cpu_s) - self._cpu_before_s
        log = self._process.log
        self._end(
            Ended(
                reason=reason,
                exit_code=code,
                signal=number,
                folder=self.folder,
                cpu_s=max(cpu_s, 0.0),
                peak_rss_bytes=peak,
                log=log.tail(),
                log_file=log.path,
                protocol_error=self._said,
            )
        )

    def _end(self, ended: Ended) -> None:
        self.ended.set_result(ended)
        if self._released:
            self._remove()

    def _remove(self) -> None:
        ended = self.ended.result()
        if ended.lives and ended.log_file is not None:
            ended.log_file.unlink(missing_ok=True)
        self._worker.release()
