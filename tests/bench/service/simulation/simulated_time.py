"""An event loop whose clock stands while anything is done, and jumps to the next timer when nothing is left to do.

Calls in threads (the store's, the disk's) really happen; the clock waits for them. So hours of a farm pass in the time that
the dispatcher and the database need for them.
"""

from __future__ import annotations

import asyncio
import selectors
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

PARTS = "primray_service.dispatcher"


class SimulatedLoop(asyncio.SelectorEventLoop):
    def __init__(self) -> None:
        super().__init__(_Selector(self))
        self.now = 0.0
        self.calls = 0  # in threads

    def time(self) -> float:
        return self.now

    def run_in_executor(self, executor: Any, func: Any, *args: Any) -> Any:  # type: ignore[override]
        self.calls += 1
        future = super().run_in_executor(executor, func, *args)
        future.add_done_callback(self._called)
        return future

    def _called(self, _: object) -> None:
        self.calls -= 1


class _Selector(selectors.DefaultSelector):
    """Waits for threads, never for the clock."""

    def __init__(self, loop: SimulatedLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> Any:
        if timeout is None or (timeout > 0 and self._loop.calls > 0):
            return super().select(None)
        self._loop.now += max(timeout, 0.0)
        return super().select(0)


class _Time(ModuleType):
    """The module `time`, by the loop's clock where it tells the time."""

    def __init__(self, loop: SimulatedLoop, began: float) -> None:
        super().__init__("time")
        self._loop = loop
        self._began = began

    def time(self) -> float:
        return self._began + self._loop.now

    def monotonic(self) -> float:
        return self._loop.now

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)


@contextmanager
def simulated_time() -> Iterator[SimulatedLoop]:
    """A loop, by whose clock all of the dispatcher goes meanwhile."""
    import primray_service.dispatcher.dispatcher  # noqa: F401  (with all of its parts)

    loop = SimulatedLoop()
    told = _Time(loop, time.time())
    parts = [module for name, module in sys.modules.items() if name.startswith(PARTS) and vars(module).get("time") is time]
    for module in parts:
        vars(module)["time"] = told
    try:
        asyncio.set_event_loop(loop)
        yield loop
    finally:
        for module in parts:
            vars(module)["time"] = time
        asyncio.set_event_loop(None)
        loop.close()
