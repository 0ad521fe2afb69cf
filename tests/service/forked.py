"""Servers' processes, forked from one that has imported what a server imports: most of a start, and the same each time.

python -m tests.service.forked HANDLE      (the one that forks; it ends with the process that started it)
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import select
import selectors
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

ROOT = Path(__file__).parents[2]
PATHS = {"PYTHONPATH": os.pathsep.join([str(ROOT / "renderer"), str(ROOT / "service")])}
REQUEST_BYTES = 2**17
PID_BYTES = 8


class Process(Protocol):
    """As much of subprocess.Popen as a server's tests need."""

    pid: int

    def poll(self) -> int | None: ...
    def wait(self, timeout: float | None = None) -> int: ...
    def send_signal(self, sig: int) -> None: ...
    def kill(self) -> None: ...


class Forked:
    """A process whose parent, the one that forks, tells its exit code over a pipe."""

    def __init__(self, told: int) -> None:
        self._told = told
        self.pid = int.from_bytes(os.read(told, PID_BYTES), "big")
        self.returncode: int | None = None
        assert self.pid > 0, "the process that forks has died"

    def poll(self) -> int | None:
        return self._ended(0.0)

    def wait(self, timeout: float | None = None) -> int:
        code = self._ended(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(f"server {self.pid}", timeout or 0.0)
        return code

    def _ended(self, timeout_s: float | None) -> int | None:
        if self.returncode is not None:
            return self.returncode
        poll = select.poll()
        poll.register(self._told, select.POLLIN)
        if poll.poll(None if timeout_s is None else 1000 * timeout_s):
            self.returncode = int(os.read(self._told, 16))
            os.close(self._told)
        return self.returncode

    def send_signal(self, sig: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, sig)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


_forking: list[socket.socket] = []


def _channel() -> socket.socket:
    """To the process that forks, which is started at the first server."""
    if not _forking:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        command = [sys.executable, "-m", "tests.service.forked", str(theirs.fileno())]
        process = subprocess.Popen(command, cwd=ROOT, env={**os.environ, **PATHS}, pass_fds=[theirs.fileno()])
        theirs.close()
        atexit.register(_end, ours, process)
        _forking.append(ours)
    return _forking[0]


def _end(channel: socket.socket, process: subprocess.Popen[bytes]) -> None:
    channel.close()
    process.wait(20)


def start(settings: Mapping[str, Any], log: int) -> Forked:
    """A server with this process's environment as it is now, which prints to `log`. `settings`: serving.config_of's."""
    told, tell = os.pipe()
    request = json.dumps({"settings": settings, "environment": {**os.environ, **PATHS}}).encode()
    assert len(request) <= REQUEST_BYTES
    socket.send_fds(_channel(), [request], [log, tell])
    os.close(tell)
    return Forked(told)


def fork_when_asked(channel: socket.socket) -> Mapping[str, Any] | None:
    """In each child the server's settings; None where it was asked, at the end."""
    with selectors.DefaultSelector() as selector:
        selector.register(channel, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.data is not None:
                    _tell_the_end(selector, key)
                    continue
                request, handles, _, _ = socket.recv_fds(channel, REQUEST_BYTES, 2)
                if not request:
                    return None
                pid = os.fork()
                if pid == 0:
                    return _become(json.loads(request), handles[0])
                log, tell = handles
                os.close(log)
                os.write(tell, pid.to_bytes(PID_BYTES, "big"))
                selector.register(os.pidfd_open(pid), selectors.EVENT_READ, (pid, tell))


def _tell_the_end(selector: selectors.BaseSelector, key: selectors.SelectorKey) -> None:
    pid, tell = key.data
    _, status = os.waitpid(pid, 0)
    selector.unregister(key.fileobj)
    os.close(key.fd)
    with contextlib.suppress(BrokenPipeError):  # nobody wants to know
        os.write(tell, str(os.waitstatus_to_exitcode(status)).encode())
    os.close(tell)


def _become(request: Mapping[str, Any], log: int) -> Mapping[str, Any]:
    """What a process that was started by itself would be: nothing open but its channels, and Ctrl-C ends it."""
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.environ.clear()
    os.environ.update(request["environment"])
    signal.signal(signal.SIGINT, signal.default_int_handler)
    settings: Mapping[str, Any] = request["settings"]
    return settings


def main(handle: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a server is stopped by its test, or with it
    from tests.service.serving import config_of

    from primray_service.server import serve

    channel = socket.socket(fileno=handle)
    settings = fork_when_asked(channel)
    if settings is None:
        os._exit(0)  # all that was imported need not be taken down
    channel.detach()
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))
    serve(config_of(dict(settings)))


if __name__ == "__main__":
    main(int(sys.argv[1]))
