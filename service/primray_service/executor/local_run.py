"""One chunk's life in a worker on this machine: its files are linked, it is watched, its end is reported."""

from __future__ import annotations

import asyncio
import json
import logging
import signal
import time
from collections.abc import Callable
from pathlib import Path

from ..jobs import Json
from ..limits import Limits
from ..sandbox import decode_exit
from ..worker.protocol import LAST
from . import watchdog
from .base import Chunk, Ended, OnMessage
from .local_worker import Worker
from .messages import BadMessage, parse
from .process import Exit

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
        self._told: list[bytes] | None = []  # until its first command is sent
        self._reason = ""
        self._said = ""  # what was wrong with its messages
        self._last = ""
        self._sampling = False
        self._released = False
        self._used = watchdog.used_by(self._process.pid)
        self._cpu_before_s = self._used.cpu_s
        self._peak_bytes = 0
        worker.begin(chunk)
        self._process.on_line = self._on_line
        self._process.exit.add_done_callback(self._on_exit)
        self._work = asyncio.ensure_future(self._run())

    @property
    def pid(self) -> int:
        """Return the pid of the process that was started; a sandbox's processes may be around the worker."""
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
        if self._told is not None:
            self._told.append(line)
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
        told, self._told = self._told or [], None
        self._process.write(self._command + b"\n" + b"".join(told))

    async def _watch(self) -> None:
        start = time.monotonic()
        load_wall_s = LOAD_WALL_PER_CPU * self.chunk.load_cpu_s
        next_folder = start
        while not self._process.exit.done() and not self.ended.done():
            self._look()
            now = time.monotonic()
            if now >= next_folder:
                next_folder = now + LOOK_AT_FOLDER_EVERY_S
                if watchdog.folder_bytes(self.folder, self._limits.output_bytes) > self._limits.output_bytes:
                    self._kill("storage-limit")
            if now - start > load_wall_s + (2 * self._limits.seconds if self._sampling else 0):
                self._kill("time-limit")
            await asyncio.wait({self._process.exit}, timeout=LOOK_EVERY_S)

    def _look(self) -> None:
        used = watchdog.used_by(self._process.pid)
        if used.cpu_s < self._used.cpu_s:
            return  # it has just ended, or only the sandbox's processes are left
        self._used = used
        peak = watchdog.peak_rss_bytes(watchdog.innermost(self._process.pid))
        self._peak_bytes = max(self._peak_bytes, used.rss_bytes, peak)
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
            self._process.kill(watchdog.innermost(self._process.pid))

    def _stay(self) -> None:
        self._look()
        cpu_s = self._used.cpu_s - self._cpu_before_s
        left = watchdog.folder_bytes(self.folder, self._limits.output_bytes)
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
        reason = self._reason or ("exited" if number is None else SIGNALS.get(signal.Signals(number), "signal"))
        peak = self._peak_bytes
        if end.max_rss_bytes > self._process.parent_peak_bytes:  # so it is its own
            peak = max(peak, end.max_rss_bytes)
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
