"""One worker process and its three pipes, in the event loop that started it: lines in, commands out, its end; and its usage.

A worker is started as a program (`StartedProcess`), or forked (fork_server.py).

Everything is bounded: line length, output, and the rate of messages. It belongs to the loop's thread, which must be the main
one: workers die with the thread that started them. Memory and CPU seconds of its processes together are read from /proc.
"""

from __future__ import annotations

import asyncio
import os
import re
import signal
import subprocess
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol

from primray.report.report import peak_rss_bytes

from ..worker.protocol import MAX_LINE_BYTES

READ_BYTES = 2**16
# A worker that sends more in a second is throttled: reading it must not keep the server from its clients.
BYTES_A_SECOND, LINES_A_SECOND = 8 * 2**20, 2000


class Start(Protocol):
    """Command, environment and folder of a process."""

    @property
    def argv(self) -> list[str]: ...
    @property
    def env(self) -> dict[str, str]: ...
    @property
    def cwd(self) -> str: ...


@dataclass(frozen=True)
class Exit:
    returncode: int  # negative: a signal
    cpu_s: float  # of it and of all children that it has waited for
    max_rss_bytes: int  # 0: unknown
    lost: bool = False  # nobody knows how it ended


@dataclass(frozen=True)
class Pipes:
    """The server's ends of a worker's pipes."""

    stdin: IO[bytes]
    stdout: IO[bytes]
    stderr: IO[bytes]


OnLine = Callable[[bytes], None]


class WorkerProcess(ABC):
    """A worker behind its pipes. `on_line` gets complete lines without their end, in order, and the beginning of one that is
    too long."""

    def __init__(self, pipes: Pipes, log: Path, log_bytes: int, on_line: OnLine) -> None:
        self._loop = asyncio.get_running_loop()
        self.on_line = on_line
        self._log_bytes = log_bytes
        self.log = ProcessLog(log, log_bytes)
        self.exit: asyncio.Future[Exit] = self._loop.create_future()
        self._stdin, self._stdout, self._stderr = pipes.stdin, pipes.stdout, pipes.stderr
        for pipe in (self._stdin, self._stdout, self._stderr):
            os.set_blocking(pipe.fileno(), False)
        self._to_write = bytearray()
        self._line = bytearray()
        self._second = time.monotonic()
        self._bytes = self._lines = 0
        self._loop.add_reader(self._stdout.fileno(), self._read_messages)
        self._loop.add_reader(self._stderr.fileno(), self._read_log)

    @property
    @abstractmethod
    def pid(self) -> int:
        """Return the id of the process that does the work, or of one around it; ProcessLookupError before it exists."""

    @abstractmethod
    def used(self) -> Used:
        """Return what it and its descendants use."""

    @abstractmethod
    def peak_rss_bytes(self) -> int:
        """Return the most memory that the worker has held; 0 if it is gone."""

    @abstractmethod
    def kill(self, *, gently: bool = False) -> None:
        """End it now; `gently`: so that those around it can report its usage."""

    def write(self, line: bytes) -> None:
        if self.exit.done() or self._stdin.closed:
            return
        self._to_write += line
        self._flush()

    def _flush(self) -> None:
        try:
            while self._to_write:
                del self._to_write[: os.write(self._stdin.fileno(), self._to_write)]
        except BlockingIOError:
            self._loop.add_writer(self._stdin.fileno(), self._flush)
            return
        except OSError:  # it is gone, or has closed its stdin: its end is reported elsewhere
            self._to_write.clear()
        self._loop.remove_writer(self._stdin.fileno())

    def _read_messages(self) -> None:
        data = _read(self._stdout.fileno())
        if data is None:
            return
        if not data:
            self._loop.remove_reader(self._stdout.fileno())
            return
        self._take(data)
        now = time.monotonic()
        if now - self._second >= 1:
            self._second, self._bytes, self._lines = now, 0, 0
        if self._bytes > BYTES_A_SECOND or self._lines > LINES_A_SECOND:
            self._loop.remove_reader(self._stdout.fileno())
            self._loop.call_later(self._second + 1 - now, self._listen_again)

    def _listen_again(self) -> None:
        if not self._stdout.closed:
            self._loop.add_reader(self._stdout.fileno(), self._read_messages)

    def _take(self, data: bytes) -> None:
        self._bytes += len(data)
        *lines, rest = data.split(b"\n")
        self._lines += len(lines)
        for line in lines:
            whole, self._line = self._line + line, bytearray()
            self.on_line(bytes(whole))
        self._line += rest
        if len(self._line) > MAX_LINE_BYTES:
            whole, self._line = self._line, bytearray()
            self.on_line(bytes(whole))

    def _read_log(self) -> None:
        data = _read(self._stderr.fileno())
        if data:
            self.log.add(data)
        elif data is not None:
            self._loop.remove_reader(self._stderr.fileno())

    def begin_log(self) -> None:
        """Discard the log so far."""
        self._read_log()
        self.log.begin()

    def change_log(self, path: Path) -> Path:
        """Switch the log to another file, and return the complete old one."""
        self._read_log()
        whole = self.log
        whole.close()
        self.log = ProcessLog(path, self._log_bytes)
        return whole.path

    def _close(self, ended: Exit) -> None:
        """Read what the pipes still hold, whoever else has them open, and report the end."""
        for pipe, take in ((self._stdout, self._take), (self._stderr, self.log.add)):
            self._loop.remove_reader(pipe.fileno())
            for _ in range(64):
                data = _read(pipe.fileno())
                if not data:
                    break
                take(data)
            pipe.close()
        self._loop.remove_writer(self._stdin.fileno())
        self._stdin.close()
        self.log.close()
        if not self.exit.done():
            self.exit.set_result(ended)


class StartedProcess(WorkerProcess):
    """A worker that was started as a program. `pass_fds`: files that it inherits beside its pipes."""

    def __init__(self, start: Start, log: Path, log_bytes: int, on_line: OnLine, pass_fds: Sequence[int] = ()) -> None:
        # A child started by vfork inherits its parent's peak in its own.
        self._parent_peak_bytes = peak_rss_bytes()
        child = subprocess.Popen(
            start.argv,
            env=start.env,
            cwd=start.cwd,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            bufsize=0,
            pass_fds=pass_fds,
        )
        child.returncode = 0  # reaped here; Popen must not do it
        self._child = child.pid
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stderr is not None
        super().__init__(Pipes(child.stdin, child.stdout, child.stderr), log, log_bytes, on_line)
        self._pidfd = os.pidfd_open(self._child)
        self._loop.add_reader(self._pidfd, self._ended)

    @property
    def pid(self) -> int:
        return self._child

    def used(self) -> Used:
        return used_by(self._child)

    def peak_rss_bytes(self) -> int:
        return peak_rss_bytes_of(innermost(self._child))

    def kill(self, *, gently: bool = False) -> None:
        if self.exit.done():
            return
        inner = innermost(self._child) if gently else self._child
        if inner != self._child:
            with suppress(ProcessLookupError):
                os.kill(inner, signal.SIGKILL)
            self._loop.call_later(0.25, self.kill)
            return
        with suppress(ProcessLookupError):
            os.killpg(self._child, signal.SIGKILL)

    def _ended(self) -> None:
        _, status, usage = os.wait4(self._child, 0)
        self._loop.remove_reader(self._pidfd)
        os.close(self._pidfd)
        peak = usage.ru_maxrss * 1024
        own_peak = peak if peak > self._parent_peak_bytes else 0
        self._close(Exit(os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, own_peak))


def _read(handle: int) -> bytes | None:
    """Return bytes; None: nothing now; b"": end of file."""
    try:
        return os.read(handle, READ_BYTES)
    except BlockingIOError:
        return None
    except OSError:
        return b""


TAIL_BYTES = 8192


class ProcessLog:
    """Log with at most `most_bytes` in its file."""

    def __init__(self, path: Path, most_bytes: int) -> None:
        self.path = path
        self._file = open(path, "xb", buffering=0)  # noqa: SIM115 - open as long as the process
        self._most = max(most_bytes - TAIL_BYTES - 200, 0)
        self.begin()

    def begin(self) -> None:
        """Discard the content so far."""
        self._file.seek(0)
        self._file.truncate()
        self._left = self._most
        self._omitted = 0
        self._tail = bytearray()

    def add(self, data: bytes) -> None:
        kept, rest = data[: self._left], data[self._left :]
        if kept:
            self._left -= len(kept)
            self._file.write(kept)
        self._omitted += len(rest)
        self._tail += data
        del self._tail[:-TAIL_BYTES]

    def tail(self) -> str:
        return self._tail.decode("utf-8", "replace")

    def close(self) -> None:
        if self._omitted:
            end = self._tail[-min(self._omitted, TAIL_BYTES) :]
            more = self._omitted - len(end)
            self._file.write(b"\n[%d bytes are left out here]\n" % more + end if more else end)
            self._omitted = 0
        self._file.close()


PAGE = os.sysconf("SC_PAGE_SIZE")
TICKS = os.sysconf("SC_CLK_TCK")
MOST_PROCESSES = 512
STOP_TRIES = 100  # a millisecond each, until a process that is to stop has stopped
MOST_FILES = 10_000  # a folder with more counts as too large


@dataclass(frozen=True)
class Used:
    rss_bytes: int = 0
    cpu_s: float = 0.0  # of living processes, and of children that they waited for


def used_by(pid: int) -> Used:
    """Return the usage of the process and all of its descendants."""
    each = [used_alone(process) for process in _tree(pid)]
    return Used(sum(used.rss_bytes for used in each), sum(used.cpu_s for used in each))


def used_alone(pid: int) -> Used:
    """Return the usage of the process without its descendants."""
    try:
        with open(f"/proc/{pid}/stat", "rb", buffering=0) as file:
            after_name = file.read().rpartition(b")")[2].split()
        return Used(int(after_name[21]) * PAGE, sum(map(int, after_name[11:15])) / TICKS)
    except (OSError, ValueError, IndexError):
        return Used()  # it has just ended


def peak_rss_bytes_of(pid: int) -> int:
    """Return the most memory that one process has held (VmHWM); 0 if it is gone."""
    try:
        with open(f"/proc/{pid}/status", "rb", buffering=0) as file:
            found = re.search(rb"^VmHWM:\s*(\d+)", file.read(), re.MULTILINE)
    except OSError:
        return 0
    return 0 if found is None else int(found[1]) * 1024


def kill_with_children(pid: int) -> None:
    """Kill a child of this process and its own children, also while it is starting them: bubblewrap asks only later that they
    die with it."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGSTOP)  # so that it starts no more
        for _ in range(STOP_TRIES):
            if _state(pid) in "TtZX":
                break
            time.sleep(0.001)
        for process in (*_children(pid), pid):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)


def _state(pid: int) -> str:
    """Return the letter of a process's state in /proc; X: it is gone."""
    try:
        with open(f"/proc/{pid}/stat", "rb", buffering=0) as file:
            return chr(file.read().rpartition(b")")[2].split()[0][0])
    except (OSError, IndexError):
        return "X"


def innermost(pid: int) -> int:
    """Return the process at the end of a chain of only children: the worker itself, if a sandbox's processes are around it."""
    for _ in range(4):
        below = _children(pid)
        if len(below) != 1:
            return pid
        pid = below[0]
    return pid


def _tree(pid: int) -> list[int]:
    found = [pid]
    for process in found:
        found += _children(process)
        if len(found) > MOST_PROCESSES:
            break
    return found


def _children(pid: int) -> list[int]:
    """Return the children of all its threads."""
    found = []
    try:
        for thread in os.listdir(f"/proc/{pid}/task"):
            found += [int(word) for word in Path(f"/proc/{pid}/task/{thread}/children").read_text("ascii").split()]
    except (OSError, ValueError):
        pass
    return found


def folder_bytes(folder: Path, most: int) -> int:
    """Return the bytes on disk of all files below a folder; counting stops above `most`, or if there are too many files."""
    total = entries = 0
    folders = [str(folder)]
    while folders:
        try:
            with os.scandir(folders.pop()) as found:
                for entry in found:
                    entries += 1
                    if entries > MOST_FILES or total > most:
                        return most + 1
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
                    else:
                        total += entry.stat(follow_symlinks=False).st_blocks * 512
        except OSError:
            continue  # it has just been removed
    return total
