"""Messages of a chunk's worker that are not yet processed: the newest of a kind that supersedes older ones, else all in
order."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from ...jobs import Json
from . import messages
from .messages import Checkpoint, Done, Failed, NotBelieved, Preview, Yielded

MOST_CHECKPOINTS = 64  # waiting for adoption
MOST_ROWS = 2000
MOST_WARNINGS = 10_000  # per chunk; repeated ones count again


class Inbox:
    def __init__(self, now: float, convergence: list[Json]) -> None:
        self.heard_at = now
        self.phase = ""
        self.progress: Json | None = None
        self.effective: Json | None = None
        self.convergence = list(convergence)
        self.warnings: list[Json] = []
        self.preview: Preview | None = None
        self.checkpoints: deque[Checkpoint] = deque()
        self.last: Done | Yielded | Failed | None = None
        self.sampling_since: float | None = None
        self.has_news = False  # not yet in its rows
        self.is_urgent = False  # to be written at once
        self._warned = 0

    def put(self, message: Mapping[str, Any], now: float) -> None:
        """Add a message; raises NotBelieved for one that our worker does not send."""
        self.heard_at = now
        if self.last is not None:
            raise NotBelieved("a message after the last")
        at = message.get("at")
        take = getattr(self, f"_on_{at}", None) if isinstance(at, str) and at.isalpha() else None
        if take is not None:
            take(message, now)

    def _on_phase(self, message: Mapping[str, Any], now: float) -> None:
        self.phase = messages.phase_of(message)
        self.has_news = True
        if self.phase == "sampling" and self.sampling_since is None:
            self.sampling_since = now
            self.is_urgent = True

    def _on_effective(self, message: Mapping[str, Any], now: float) -> None:
        found = messages.mapping(message)
        del found["at"]
        self.effective = found
        self.has_news = True

    def _on_warning(self, message: Mapping[str, Any], now: float) -> None:
        self._warned += 1
        if self._warned > MOST_WARNINGS:
            raise NotBelieved("too many warnings")
        self.warnings.append(messages.warning_of(message))
        self.has_news = True

    def _on_progress(self, message: Mapping[str, Any], now: float) -> None:
        self.progress = messages.progress_of(message)
        self.has_news = True

    def _on_row(self, message: Mapping[str, Any], now: float) -> None:
        """Add a row of the convergence curve. A chunk that resumed from a checkpoint repeats rows that its predecessor measured
        after it."""
        row = messages.row_of(message)
        self.convergence = [earlier for earlier in self.convergence if earlier["samples"] < row["samples"]]
        if len(self.convergence) >= MOST_ROWS:
            raise NotBelieved("too many rows")
        self.convergence.append(row)
        self.has_news = True

    def _on_preview(self, message: Mapping[str, Any], now: float) -> None:
        self.preview = messages.preview_of(message)

    def _on_checkpoint(self, message: Mapping[str, Any], now: float) -> None:
        if len(self.checkpoints) >= MOST_CHECKPOINTS:
            raise NotBelieved("too many checkpoints")
        self.checkpoints.append(messages.checkpoint_of(message))

    def _on_done(self, message: Mapping[str, Any], now: float) -> None:
        self.last = messages.done_of(message)

    def _on_yielded(self, message: Mapping[str, Any], now: float) -> None:
        self.last = Yielded()

    def _on_failed(self, message: Mapping[str, Any], now: float) -> None:
        self.last = messages.failed_of(message)
