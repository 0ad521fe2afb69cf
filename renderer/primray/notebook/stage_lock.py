"""The lock of all stages that views show: threads that render hold it while they read a stage, cells while they may edit one.

USD allows no reading beside an edit. Views share layers, with each other and with stages of the notebook, so that there is one
lock for all. A kernel tells when code of the user's runs: IPython's events surround cells, and callbacks of other widgets.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType


class StageLock:
    """A reentrant lock that a cell holds at most once, however often it asks."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._of_thread = threading.local()
        self._is_following = False

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._lock.release()

    @property
    def is_held(self) -> bool:
        """Whether this thread's cell holds it."""
        return getattr(self._of_thread, "holds", False)

    def hold(self) -> None:
        if not self.is_held:
            self._lock.acquire()
            self._of_thread.holds = True

    def let_go(self) -> None:
        if self.is_held:
            self._of_thread.holds = False
            self._lock.release()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold it, as a cell does."""
        had = self.is_held
        self.hold()
        try:
            yield
        finally:
            if not had:
                self.let_go()

    @contextmanager
    def released(self) -> Iterator[None]:
        """Let threads that render go on, which the cell waits for."""
        had = self.is_held
        self.let_go()
        try:
            yield
        finally:
            if had:
                self.hold()

    def follow_cells(self, ended: Callable[[], None]) -> None:
        """From now on hold it while cells and callbacks run, and call `ended` after each; without IPython do nothing."""
        shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
        if shell is None or self._is_following:
            return

        def end() -> None:
            self.let_go()
            ended()

        self._is_following = True
        shell.events.register("pre_execute", self.hold)
        shell.events.register("post_execute", end)
        self.hold()  # this cell, too
