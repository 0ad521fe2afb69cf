"""Ctrl-C that asks instead of breaking in: a render ends between two tasks then, and what it has is saved.

Only Python's own handler is replaced, not that of whoever has one, and only on the main thread, which signals go to.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class Interruption:
    """Whether a signal came."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self, number: int, frame: Any) -> None:
        if self.asked:
            raise KeyboardInterrupt  # asked twice: at once
        self.asked = True


@contextmanager
def interruption() -> Iterator[Interruption]:
    """While it lasts, signals that would raise KeyboardInterrupt only say so."""
    asked = Interruption()
    numbers = [signal.SIGINT, signal.SIGTERM] if threading.current_thread() is threading.main_thread() else []
    replaced = [number for number in numbers if signal.getsignal(number) is signal.default_int_handler]
    for number in replaced:
        signal.signal(number, asked)
    try:
        yield asked
    finally:
        for number in replaced:
            signal.signal(number, signal.default_int_handler)


def terminate_as_interrupt() -> None:
    """SIGTERM does what Ctrl-C does, unless someone has a handler for it already or it is ignored."""
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
