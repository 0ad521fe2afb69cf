"""Workers that are forked (worker/fork_server.py), as the server sees them; and the process that they are forked from, which is
started again when it dies, and replaced after a number of workers.

Workers outlive it: each has a keeper, which reports its process id and its end over a socket of its own.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
import socket
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from ..jobs import Json
from ..limits import MiB
from ..sandbox import Budget, works
from ..sandbox.self_test import LAST, slot_and_targets
from ..sandbox.spawn import fork_server_spawn, worker_fork
from . import process
from .process import Exit, OnLine, Pipes, StartedProcess, Used, WorkerProcess
from .slots import Slot, Slots

LOG = logging.getLogger(__name__)

READY = b'{"at": "ready"}'
LOG_BYTES = 1 * MiB
READY_WITHIN_S = 120.0  # on a machine under load
TEST_WITHIN_S = 60.0
# Forked workers share a memory layout and a hash seed: who learns them from one worker must not use them for long.
REPLACED_AFTER = 256
AGAIN_AFTER_S = 2.0  # after a death; twice as long after each that follows
TRIES = 5  # starts in a row that failed
KILLED_WITHIN_S = 5.0
MESSAGE_BYTES = 4096


class ForkServer:
    """One process that workers are forked from."""

    def __init__(self, slot: Slot) -> None:
        self.slot = slot
        self.ready = asyncio.Event()
        self.forks = 0
        self._requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._requests.setblocking(False)
            start = fork_server_spawn(slot.out, theirs.fileno())
            self.process = StartedProcess(start, slot.log, LOG_BYTES, self._on_line, (theirs.fileno(),))

    def _on_line(self, line: bytes) -> None:
        if line == READY:
            self.ready.set()

    def fork(self, kind: str, request: Json, log: Path, log_bytes: int, on_line: OnLine) -> ForkedProcess:
        """Fork a worker; OSError if it cannot be requested now."""
        self.forks += 1
        return ForkedProcess(self._requests, {"targets": {}, **request, "kind": kind}, log, log_bytes, on_line)

    def leave(self) -> None:
        """Fork no more; the process ends after its workers."""
        self._requests.close()


class ForkedProcess(WorkerProcess):
    """A forked worker."""

    def __init__(self, requests: socket.socket, request: Json, log: Path, log_bytes: int, on_line: OnLine) -> None:
        self._pid: int | None = None
        with ExitStack() as theirs, ExitStack() as ours:
            (stdin, to), (out, stdout), (err, stderr) = os.pipe(), os.pipe(), os.pipe()
            pipes = Pipes(
                *(ours.enter_context(os.fdopen(h, m, buffering=0)) for h, m in ((to, "wb"), (out, "rb"), (err, "rb")))
            )
            for handle in (stdin, stdout, stderr):
                theirs.callback(os.close, handle)
            self._control, control = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            ours.enter_context(self._control)
            theirs.enter_context(control)
            socket.send_fds(requests, [json.dumps(request).encode()], [stdin, stdout, stderr, control.fileno()])
            super().__init__(pipes, log, log_bytes, on_line)
            ours.pop_all()
        self._control.setblocking(False)
        self._loop.add_reader(self._control.fileno(), self._hear)

    @property
    def pid(self) -> int:
        if self._pid is None:
            raise ProcessLookupError("the worker is not forked yet, or has ended")
        return self._pid

    def used(self) -> Used:
        return Used() if self._pid is None else process.used_alone(self._pid)  # it cannot have children

    def peak_rss_bytes(self) -> int:
        return 0 if self._pid is None else process.peak_rss_bytes_of(self._pid)

    def kill(self, *, gently: bool = False) -> None:
        if self.exit.done():
            return
        with suppress(OSError):  # its keeper is gone, which is about to be read
            self._control.send(b"kill")
        self._loop.call_later(KILLED_WITHIN_S, self._give_up)

    def _give_up(self) -> None:
        """Report the end although the keeper does not: it kills the worker when the socket is closed."""
        if not self.exit.done():
            self._end(Exit(-signal.SIGKILL, 0.0, 0, lost=True))

    def _hear(self) -> None:
        try:
            data = self._control.recv(MESSAGE_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._end(Exit(-signal.SIGKILL, 0.0, 0, lost=True))
            return
        said = json.loads(data)
        if "pid" in said:
            self._pid = said["pid"]
        else:
            self._end(Exit(os.waitstatus_to_exitcode(said["status"]), said["cpu_s"], said["max_rss_bytes"]))

    def _end(self, ended: Exit) -> None:
        self._loop.remove_reader(self._control.fileno())
        self._control.close()
        self._pid = None  # it may be another's now
        self._close(ended)


async def attempts_in(server: ForkServer, folder: Path, layers: frozenset[str] | None) -> dict[str, str]:
    """Return the self-test's attempts (sandbox/attempts.py) in a forked worker and their results; OSError if it does not get
    through them. `folder`: where slots are."""
    said: dict[str, str] = {}
    with slot_and_targets(folder) as (slot, targets):
        request = worker_fork(slot, Budget(2**31), layers) | {"targets": targets}
        tested = server.fork("attempts", request, slot / "log.txt", LOG_BYTES, lambda line: said.update(json.loads(line)))
        await asyncio.wait({tested.exit}, timeout=TEST_WITHIN_S)
        tested.kill()
        ended = await asyncio.shield(tested.exit)
        last = tested.log.tail().strip().splitlines()[-1:]
    if ended.returncode != 0 or LAST not in said:
        raise OSError(f"a forked worker cannot enter the sandbox: {' '.join(last)[:300]}")
    return said


class ForkServers:
    """The current fork server. `start` tests once whether forked workers have the whole sandbox here; if they do not, there is
    none, and workers are started as programs."""

    def __init__(self, slots: Slots, layers: frozenset[str] | None) -> None:
        self._slots = slots
        self._layers = layers
        self._current: ForkServer | None = None
        self._living: set[ForkServer] = set()
        self._starting: asyncio.Task[None] | None = None
        self._failed = 0
        self._is_closing = False
        self.why_not = "it was not started"

    @property
    def current(self) -> ForkServer | None:
        """Return the fork server that is to be asked now; after a number of workers another is started meanwhile."""
        if self._current is not None and self._current.forks >= REPLACED_AFTER and self._starting is None:
            self._start_later(0.0)
        return self._current

    async def start(self) -> None:
        try:
            found = self._make()
            await self._is_ready(found)
            await self._test(found)
        except OSError as error:
            self.why_not = str(error)
            LOG.warning("workers are started as programs: %s", error)
            for server in list(self._living):
                server.process.kill()
        else:
            self._use(found)

    async def close(self) -> None:
        """End it; its workers have ended."""
        self._is_closing = True
        self._current = None
        self.why_not = "the server is stopping"
        if self._starting is not None:
            self._starting.cancel()
        for server in list(self._living):
            server.leave()
            server.process.kill()
            await asyncio.shield(server.process.exit)

    def _make(self) -> ForkServer:
        slot = self._slots.make()
        try:
            made = ForkServer(slot)
        except BaseException:
            slot.remove()
            raise
        self._living.add(made)
        made.process.exit.add_done_callback(lambda _: self._on_exit(made))
        return made

    async def _is_ready(self, server: ForkServer) -> None:
        """Wait until it is ready; OSError with the reason if it is not in time."""
        ready = asyncio.ensure_future(server.ready.wait())
        waited: set[asyncio.Future[Any]] = {ready, server.process.exit}
        await asyncio.wait(waited, timeout=READY_WITHIN_S, return_when=asyncio.FIRST_COMPLETED)
        ready.cancel()
        if server.process.exit.done() or not server.ready.is_set():
            last = server.process.log.tail().strip().splitlines()[-1:]
            raise OSError(f"the fork server did not start: {' '.join(last)[:300]}")

    async def _test(self, server: ForkServer) -> None:
        """Run the self-test in a forked worker; OSError if it fails."""
        attempts = await attempts_in(server, self._slots.folder, self._layers)
        allowed = sorted(name for name, result in attempts.items() if result == "allowed")
        if allowed and works(self._layers):
            raise OSError(f"a forked worker can {', '.join(allowed)}")

    def _use(self, server: ForkServer) -> None:
        before, self._current = self._current, server
        self._failed = 0
        self.why_not = ""
        if before is not None:
            before.leave()

    def _on_exit(self, server: ForkServer) -> None:
        self._living.discard(server)
        asyncio.get_running_loop().run_in_executor(None, server.slot.remove)
        if server is self._current and not self._is_closing:
            self._current = None
            self.why_not = "it died"
            LOG.warning("the fork server died: %s", server.process.log.tail()[-500:])
            self._start_later(AGAIN_AFTER_S)

    def _start_later(self, delay_s: float) -> None:
        if self._starting is None and not self._is_closing:
            self._starting = asyncio.ensure_future(self._start_again(delay_s))

    async def _start_again(self, delay_s: float) -> None:
        try:
            await asyncio.sleep(delay_s)
            made = self._make()
            await self._is_ready(made)
            self._use(made)
        except OSError as error:
            self._failed += 1
            LOG.warning("no fork server could be started: %s", error)
        finally:
            self._starting = None
        if self._failed and self._current is None and self._failed < TRIES:
            self._start_later(AGAIN_AFTER_S * 2**self._failed)
