"""One chunk's life in a worker on this machine: its files are linked, it is watched, its end is reported.

Lines from a worker are untrusted: they are bounded, parsed, and refused unless they have the shape in worker/protocol.py.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..jobs import Json
from ..limits import Limits
from ..sandbox import decode_exit
from ..worker.protocol import LAST, MAX_LINE_BYTES, PHASES
from . import watchdog
from .base import Chunk, Ended, OnMessage
from .local_worker import Worker
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
        self._unsent: list[bytes] | None = []  # until its first command is sent
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


Check = Callable[[Any], bool]
MOST_TEXT = 4096
MOST_DEPTH = 32


class BadMessage(ValueError):
    """The worker's line is not a message."""


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and abs(value) < 1e300


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


def _text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MOST_TEXT


def _object(value: Any) -> bool:
    return isinstance(value, dict)


def _list(value: Any) -> bool:
    return isinstance(value, list)


def _file(value: Any) -> bool:
    """Return whether the value is the plain name of a file in the output folder."""
    return _text(value) and 0 < len(value) <= 255 and not value.startswith(".") and not set(value) & set("/\\\0\n\r")


def _sha256(value: Any) -> bool:
    return isinstance(value, str) and len(value) == 64 and not set(value) - set("0123456789abcdef")


def _or_null(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _pair(check: Check) -> Check:
    return lambda value: isinstance(value, list) and len(value) == 2 and all(map(check, value))


def _members(**checks: Check) -> Check:
    """Return a check for an object that has at least these members."""
    return lambda value: isinstance(value, dict) and all(name in value and check(value[name]) for name, check in checks.items())


def _each(check: Check) -> Check:
    return lambda value: isinstance(value, list) and all(map(check, value))


_OUTPUT = _members(name=_file, file=_file, bytes=_count, sha256=_sha256, media_type=_text)
_ERROR = _members(metric=_text, estimate=_number, ci95=_pair(_or_null(_number)), kind=_text)
_PROBLEM = _members(type=_text, title=_text, status=_count, detail=_text)

SHAPES: Mapping[str, Check] = {
    "ready": _members(),
    "phase": _members(phase=lambda value: value in PHASES),
    "effective": _members(settings=_object, features=_list, scene=_object, resolution=_pair(_count)),
    "warning": _members(code=_text, prim=_text, detail=_text, severity=_text, kind=_text, attribute=_text),
    "progress": _members(
        fraction=lambda value: _number(value) and 0 <= value <= 1,
        samples_done=_number,
        samples_min=_count,
        samples_max=_count,
        rays=_count,
        rays_per_s=_number,
        elapsed_s=_number,
        error=_or_null(_ERROR),
        eta_s=_or_null(_number),
        eta_ci95=_or_null(_pair(_or_null(_number))),
        **{"pass": _count},
    ),
    "row": _members(t_s=_number, samples=_number, relmse=_number, ci95=_pair(_or_null(_number)), rmse=_number),
    "preview": _members(file=_file, bytes=_count, **{"pass": _count}),
    "checkpoint": _members(number=_count, file=_file, bytes=_count, samples=_number, seconds=_number),
    "facts": _members(),
    "done": _members(outputs=_each(_OUTPUT), report=_object),
    "yielded": _members(number=_count),
    "failed": _members(problem=_PROBLEM),
}


def parse(line: bytes) -> dict[str, Any]:
    """Return the message of a line; raises BadMessage if it is none."""
    if len(line) > MAX_LINE_BYTES:
        raise BadMessage(f"a line of more than {MAX_LINE_BYTES} bytes")
    try:
        message = json.loads(line, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise BadMessage("a line that is not JSON") from error
    if not isinstance(message, dict) or not isinstance(message.get("at"), str):
        raise BadMessage("a line that is not a message")
    check = SHAPES.get(message["at"])
    if check is None:
        raise BadMessage(f"an unknown message {message['at'][:40]!r}")
    if not check(message) or _depth(message) > MOST_DEPTH:
        raise BadMessage(f"a malformed message {message['at']!r}")
    return message


def _no_constant(name: str) -> float:
    raise ValueError(name)


def _depth(value: Any) -> int:
    if isinstance(value, dict):
        return 1 + max(map(_depth, value.values()), default=0)
    return 1 + max(map(_depth, value), default=0) if isinstance(value, list) else 0
