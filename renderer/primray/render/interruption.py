"""Ctrl-C as a request: the render ends between two tasks, and its samples are saved.

Only Python's own signal handler is replaced, not one that the application installed, and only on the main thread, which
receives signals.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn

INTERRUPTED = 130  # the exit code


class Interruption:
    """Signal handler that records whether a signal arrived."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self, number: int, frame: Any) -> None:
        if self.asked:
            raise KeyboardInterrupt  # the second signal stops at once
        self.asked = True


@contextmanager
def interruption() -> Iterator[Interruption]:
    """Within the block, signals that would raise KeyboardInterrupt are recorded instead."""
    asked = Interruption()
    numbers = [signal.SIGINT, signal.SIGTERM] if threading.current_thread() is threading.main_thread() else []
    raising = (signal.default_int_handler, interrupt)
    replaced = {number: handler for number in numbers if (handler := signal.getsignal(number)) in raising}
    for number in replaced:
        signal.signal(number, asked)
    try:
        yield asked
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)


def terminate_as_interrupt() -> None:
    """Make SIGTERM act like Ctrl-C, unless it is ignored or has a handler already."""
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, signal.default_int_handler)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, or end the process at once while a module is imported.

    pxr imports modules from C++, which swallows an exception or turns it into another one; the command would continue, or fail
    with an error that is not the user's. Nothing is lost by ending there.
    """
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            end_at_once()
        frame = frame.f_back
    raise KeyboardInterrupt


def end_at_once(number: int = 0, frame: FrameType | None = None) -> NoReturn:
    """End the process with a message on stderr, without cleaning up."""
    try:
        os.write(2, b"interrupted\n")
    finally:
        os._exit(INTERRUPTED)


def install(handler: Any) -> None:
    """Let `handler` receive the signals that ask the process to end, except ignored ones and those with foreign handlers."""
    ours = (signal.default_int_handler, interrupt, end_at_once)
    if signal.getsignal(signal.SIGINT) in ours:
        signal.signal(signal.SIGINT, handler)
    if signal.getsignal(signal.SIGTERM) in (signal.SIG_DFL, *ours):
        signal.signal(signal.SIGTERM, handler)
