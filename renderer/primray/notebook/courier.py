"""Sending of a view's state and pictures to the page: the newest, once what was sent before has been drawn.

A server of notebooks drops messages of a kernel that sends more than a megabyte a second for three seconds, so that what all
views of a kernel send stays well below.
"""

from __future__ import annotations

import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..images.writers import write_view
from ..live.viewer import Viewer

PATIENCE_S = 10.0  # after which a message that nobody has drawn is taken for lost
WINDOW_S, MOST_BYTES = 3.0, 1_500_000
LARGEST_PNG = 1_000_000  # bytes of a finished picture that is sent without loss
QUALITY = 90  # of JPEGs
ROWS = 50  # of diagnostics, and of cameras
PICTURE = ("phase", "doing", "problem", "size", "samples", "relmse", "seconds", "picture")
TOLD = (*PICTURE, "camera", "moved", "times", "selected", "explained", "lights")

Send = Callable[[dict[str, Any], list[bytes]], None]


class Allowance:
    """The bytes that may be sent now: at most MOST_BYTES in WINDOW_S, by all views together."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sent: deque[tuple[float, int]] = deque()

    def delay(self, size: int, now: float) -> float:
        """Return for how long to wait before `size` bytes may be sent, which are then counted: 0 if they were."""
        with self._lock:
            while self._sent and self._sent[0][0] <= now - WINDOW_S:
                self._sent.popleft()
            if self._sent and size + sum(count for _, count in self._sent) > MOST_BYTES:
                return self._sent[0][0] + WINDOW_S - now
            self._sent.append((now, size))
            return 0.0


ALLOWANCE = Allowance()


class Courier:
    """Thread that sends a viewer's news. `told` gets each state before it is sent; both are called from the thread."""

    def __init__(self, viewer: Viewer, send: Send, told: Callable[[dict[str, Any]], None], news: threading.Condition) -> None:
        self._viewer = viewer
        self._send = send
        self._told = told
        self._news = news
        self._has_news = True
        self._number = 0  # of the last message
        self._sent_at: float | None = None  # None: it has been drawn
        self._picture: int | None = None  # the number of the picture that was sent last
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="courier", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def changed(self) -> None:
        """Note that the viewer has something new; called from any thread."""
        with self._news:
            self._has_news = True
            self._news.notify_all()

    def drawn(self, number: int) -> None:
        """Note that the page has drawn a message."""
        with self._news:
            if number == self._number:
                self._sent_at = None
                self._news.notify_all()

    def begin_again(self) -> None:
        """Send all that there is, to a page that has just come."""
        with self._news:
            self._picture, self._sent_at, self._has_news = None, None, True
            self._news.notify_all()

    def close(self) -> None:
        with self._news:
            self._closed = True
            self._news.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while self._is_due():
            state, shown = self._viewer.state(), self._viewer.shown
            if state["picture"] != (0 if shown is None else shown.number):
                continue  # the state of this picture is about to come
            self._told(state)
            content = {"kind": "update", "state": brief(state), "picture": None}
            buffers: list[bytes] = []
            number = None
            if shown is not None and shown.number != self._picture:
                file, media_type = encoded(shown.rgba, state["phase"] == "finished")
                content["picture"] = {"type": media_type, "token": shown.token}
                buffers.append(file)
                number = shown.number
            if not self._may_send(sum(map(len, buffers))):
                return
            with self._news:
                self._number += 1
                self._sent_at = time.monotonic()
                if number is not None:  # else a page that has come meanwhile still waits for its picture
                    self._picture = number
            self._send({**content, "number": self._number}, buffers)

    def _is_due(self) -> bool:
        """Wait until there are news and the page has drawn the last ones; return False where nothing is to be sent any more."""
        with self._news:
            while not self._closed:
                late = None if self._sent_at is None else self._sent_at + PATIENCE_S - time.monotonic()
                if self._has_news and (late is None or late <= 0):
                    self._has_news = False
                    return True
                self._news.wait(late if self._has_news else None)
        return False

    def _may_send(self, size: int) -> bool:
        while (wait := ALLOWANCE.delay(size, time.monotonic())) > 0:
            with self._news:
                if self._news.wait_for(lambda: self._closed, wait):
                    return False
        return True


def brief(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the page shows of a viewer's state."""
    found = {name: state[name] for name in TOLD if name in state}
    rows = state.get("diagnostics", [])
    found["diagnostics"] = rows[:ROWS]
    found["counts"] = Counter(row["severity"] for row in rows)
    found["cameras"] = state.get("cameras", [])[:ROWS]
    found["time"] = state.get("set", {}).get("time_code")
    return found


def encoded(rgba: npt.NDArray[np.uint8], is_finished: bool) -> tuple[bytes, str]:
    """Return a picture (H, W, 4) as a file with its media type: without loss if it is finished or shows what is behind it."""
    is_opaque = bool((rgba[..., 3] == 255).all())
    with tempfile.TemporaryDirectory() as folder:
        if is_finished or not is_opaque:
            png = Path(folder, "picture.png")
            write_view(np.ascontiguousarray(rgba[..., :3]) if is_opaque else rgba, str(png))
            if not is_opaque or png.stat().st_size <= LARGEST_PNG:
                return png.read_bytes(), "image/png"
        jpeg = Path(folder, "picture.jpg")
        write_view(np.ascontiguousarray(rgba[..., :3]), str(jpeg), QUALITY)
        return jpeg.read_bytes(), "image/jpeg"
