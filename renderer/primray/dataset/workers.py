"""Executors of samples: the interface of all of them, and processes on this machine."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Protocol

from ..errors import PrimrayError, SettingsError
from ..report.report import usable_threads
from .worker import PROGRAM, error_of

LAST_CHARACTERS = 500  # of a process's output that an error quotes
ATTEMPTS = 2  # of a sample whose process dies

Done = Callable[[Mapping[str, Any]], None]  # called with each answer of a worker, in the caller's thread


class SampleExecutor(Protocol):
    """Has samples made by workers; delivery is at least once."""

    def run(self, order: Mapping[str, Any], samples: Sequence[int], done: Done) -> None:
        """Make all samples of an order, and call `done` with each answer; PrimrayError for the first that cannot be made."""


class LocalWorkers:
    """Makes samples in processes on this machine, which share its cores unless the order says how many threads each has.

    A process that dies is replaced, and its sample made again, once. SettingsError for less than one process.
    """

    def __init__(self, processes: int = 1) -> None:
        if processes < 1:
            raise SettingsError(f"the number of processes must be 1 or more, not {processes}", code="parts-setting")
        self._count = processes

    def run(self, order: Mapping[str, Any], samples: Sequence[int], done: Done) -> None:
        count = min(self._count, len(samples))
        if not count:
            return
        threads = order["threads"] or max(usable_threads() // count, 1)
        shared = _Shared({**order, "threads": threads}, samples)
        following = [threading.Thread(target=shared.follow, name="samples", daemon=True) for _ in range(count)]
        for each in following:
            each.start()
        try:
            for _ in samples:
                answer = shared.answers.get()
                if isinstance(answer, BaseException):
                    raise answer
                if "error" in answer:
                    raise error_of(answer)
                done(answer)
        finally:
            shared.stop()
            for each in following:
                each.join()


class _Shared:
    """The samples that are left, and the processes that make them."""

    def __init__(self, order: Mapping[str, Any], samples: Sequence[int]) -> None:
        self.answers: queue.Queue[Mapping[str, Any] | BaseException] = queue.Queue()
        self._order, self._left = json.dumps(order), deque(samples)
        self._running: set[subprocess.Popen[str]] = set()
        self._lock = threading.Lock()
        self._stopped = False

    def stop(self) -> None:
        with self._lock:
            self._stopped = True
            self._left.clear()
            for process in self._running:
                process.kill()

    def _started(self) -> subprocess.Popen[str] | None:
        with self._lock:
            if self._stopped:
                return None
            pipe = subprocess.PIPE
            process = subprocess.Popen(
                [sys.executable, "-m", PROGRAM], stdin=pipe, stdout=pipe, stderr=pipe, text=True, start_new_session=True
            )
            self._running.add(process)
            return process

    def follow(self) -> None:
        """Run processes, one after the other where they die, until no sample is left."""
        try:
            index, attempts = self._next(), 1
            while index is not None:
                process = self._started()
                if process is None:
                    return
                heard: deque[str] = deque(maxlen=40)
                listening = threading.Thread(target=_listen, args=(process, heard), daemon=True)
                listening.start()
                try:
                    index, attempts = self._given(process, index, attempts)
                finally:
                    self._end(process)
                    listening.join()
                if index is None or self._stopped:
                    return
                if attempts > ATTEMPTS:
                    said = "".join(heard).strip()[-LAST_CHARACTERS:]
                    raise PrimrayError(
                        f"the process that makes it ended {ATTEMPTS} times, with {process.returncode}: {said}",
                        where=f"sample {index}",
                        code="dataset-worker",
                    )
        except BaseException as error:
            self.answers.put(error)

    def _next(self) -> int | None:
        with self._lock:
            return self._left.popleft() if self._left else None

    def _given(self, process: subprocess.Popen[str], index: int, attempts: int) -> tuple[int | None, int]:
        """Give a process one sample after the other; return the one at which it died, with the next attempt's number."""
        assert process.stdin is not None
        assert process.stdout is not None
        at: int | None = index
        with suppress(BrokenPipeError):
            process.stdin.write(self._order + "\n")
            while at is not None:
                process.stdin.write(f"{at}\n")
                process.stdin.flush()
                line = process.stdout.readline()
                if not line.endswith("\n"):
                    break
                answer = json.loads(line)
                self.answers.put(answer)
                if "error" in answer:
                    return None, 1
                at, attempts = self._next(), 1
        if at is None:
            return None, 1
        return at, attempts + 1

    def _end(self, process: subprocess.Popen[str]) -> None:
        assert process.stdin is not None
        with suppress(BrokenPipeError):
            process.stdin.close()
        process.wait()
        with self._lock:
            self._running.discard(process)


def _listen(process: subprocess.Popen[str], heard: deque[str]) -> None:
    assert process.stderr is not None
    heard.extend(process.stderr)
