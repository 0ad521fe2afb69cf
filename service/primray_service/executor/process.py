"""One worker process and its three pipes, in the event loop that started it: lines in, commands out, its end; and its usage.

Everything is bounded: line length, output, and the rate of messages. It belongs to the loop's thread, which must be the main
one: workers die with the thread that started them. Memory and CPU seconds of its processes together are read from /proc.
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

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
    max_rss_bytes: int


OnLine = Callable[[bytes], None]


class WorkerProcess:
    """A process. `on_line` gets complete lines without their end, in order, and the beginning of one that is too long."""

    def __init__(self, start: Start, log: Path, log_bytes: int, on_line: OnLine) -> None:
        self._loop = asyncio.get_running_loop()
        self.on_line = on_line
        self._log_bytes = log_bytes
        self.log = ProcessLog(log, log_bytes)
        self.exit: asyncio.Future[Exit] = self._loop.create_future()
        # A child started by vfork inherits its parent's peak in its own.
        self.parent_peak_bytes = peak_rss_bytes()
        child = subprocess.Popen(
            start.argv,
            env=start.env,
            cwd=start.cwd,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            bufsize=0,
        )
        child.returncode = 0  # reaped here; Popen must not do it
        self.pid = child.pid
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stderr is not None
        self._stdin, self._stdout, self._stderr = child.stdin, child.stdout, child.stderr
        for pipe in (self._stdin, self._stdout, self._stderr):
            os.set_blocking(pipe.fileno(), False)
        self._to_write = bytearray()
        self._line = bytearray()
        self._second = time.monotonic()
        self._bytes = self._lines = 0
        self._pidfd = os.pidfd_open(self.pid)
        self._loop.add_reader(self._stdout.fileno(), self._read_messages)
        self._loop.add_reader(self._stderr.fileno(), self._read_log)
        self._loop.add_reader(self._pidfd, self._ended)

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

    def kill(self, inner: int | None = None) -> None:
        """End it; `inner` is the process to kill first, so that those around it can report its usage."""
        if self.exit.done():
            return
        if inner is not None and inner != self.pid:
            with suppress(ProcessLookupError):
                os.kill(inner, signal.SIGKILL)
            self._loop.call_later(0.25, self.kill)
            return
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)

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

    def _ended(self) -> None:
        _, status, usage = os.wait4(self.pid, 0)
        self._loop.remove_reader(self._pidfd)
        os.close(self._pidfd)
        # Its last lines are still in the pipes: read as much as they hold, whoever else has them open.
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
        code = os.waitstatus_to_exitcode(status)
        if not self.exit.done():
            self.exit.set_result(Exit(code, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024))


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
MOST_FILES = 10_000  # a folder with more counts as too large


@dataclass(frozen=True)
class Used:
    rss_bytes: int = 0
    cpu_s: float = 0.0  # of living processes, and of children that they waited for


def used_by(pid: int) -> Used:
    """Return the usage of the process and all of its descendants."""
    rss = cpu = 0
    for process in _tree(pid):
        try:
            rss += int(Path(f"/proc/{process}/statm").read_text("ascii").split()[1])
            after_name = Path(f"/proc/{process}/stat").read_bytes().rpartition(b")")[2].split()
            cpu += sum(map(int, after_name[11:15]))
        except (OSError, ValueError, IndexError):
            continue  # it has just ended
    return Used(rss * PAGE, cpu / TICKS)


def peak_rss_bytes_of(pid: int) -> int:
    """Return the most memory that one process has held (VmHWM); 0 if it is gone."""
    try:
        for line in Path(f"/proc/{pid}/status").read_text("ascii", "replace").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return 0


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
