"""Kills that surely cost an executor a part. One kill may hit processes that have just ended theirs, or that wait."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

from primray.distributed.executor import PartLost
from primray.settings import RenderSettings
from primray_service.farm.ray_parts import RayParts


class KillsUntilLost:
    """Something to watch a render's progress with: once samples have come, it kills all `workers` whenever it is called, until
    one of the executor's parts is lost."""

    def __init__(self, parts: RayParts, workers: Callable[[], list[int]]) -> None:
        self.killed: set[int] = set()
        self._workers = workers
        self._lost = False
        self._submit = parts.submit
        parts.submit = self._watched  # type: ignore[method-assign]
        self._restore = lambda: setattr(parts, "submit", self._submit)

    def __call__(self, fraction: float, samples: int, rays: int) -> None:
        if not samples or self._lost:
            return
        for pid in self._workers():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
                self.killed.add(pid)

    def __enter__(self) -> KillsUntilLost:
        return self

    def __exit__(self, *_: object) -> None:
        self._restore()

    def _watched(self, settings: RenderSettings, file: Path) -> Future[None]:
        future = self._submit(settings, file)
        future.add_done_callback(self._look)
        return future

    def _look(self, future: Future[None]) -> None:
        self._lost |= not future.cancelled() and isinstance(future.exception(), PartLost)
