"""Announcement of warnings and errors: one Python warning per render, and a `logging` record for each diagnostic.

This serves callers of the library; the command line and the service show diagnostics themselves and announce nothing.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterable
from typing import Any

from ..diagnostic_codes import Severity
from ..diagnostics import Diagnostic
from .diagnostics_text import diagnostics_lines

LOGGER = "primray"
MOST_LINES = 20


class RenderWarning(UserWarning):
    """The picture is not, or may not be, what the stage specifies: some of its diagnostics are warnings or errors.

    Each render issues at most one, with all diagnostics as text. Each diagnostic also goes to the logger "primray", with `code`
    and `prim_path` on the record. `Image.report["diagnostics"]` has all of them as data, including informational ones. The
    warning is silenced by:

    >>> warnings.filterwarnings("ignore", category=primray.RenderWarning)

    With "error" instead of "ignore" a render stops before its first sample; `RenderSettings(strict=True)` does so only for
    diagnostics that change the picture.
    """


class Announcer:
    """Announcer of one render's diagnostics; each is announced once."""

    def __init__(self, stage: object) -> None:
        self._stage = os.path.basename(os.fspath(stage)) if isinstance(stage, str | os.PathLike) else "the stage"
        self._told: set[Diagnostic] = set()

    def tell(self, diagnostics: Iterable[Diagnostic]) -> None:
        """Announce the diagnostics that are new; raise RenderWarning if warnings are errors."""
        news = [d for d in diagnostics if d.severity is not Severity.INFO and d not in self._told]
        if not news:
            return
        self._told.update(news)
        _log(news)
        warnings.warn(self._sentence(news), RenderWarning, stacklevel=_levels_to_caller())

    def _sentence(self, news: list[Diagnostic]) -> str:
        lines = diagnostics_lines(d.as_json() for d in news)
        if len(lines) > MOST_LINES:
            lines = [*lines[:MOST_LINES], f"and {len(lines) - MOST_LINES} more lines: image.report['diagnostics'] has all"]
        return "\n  ".join([f"{self._stage}: {_counted(news)}", *lines])


def _counted(news: list[Diagnostic]) -> str:
    counts = ((severity.value, sum(d.severity is severity for d in news)) for severity in (Severity.ERROR, Severity.WARNING))
    return ", ".join(f"{count:,} {name}{'s' if count > 1 else ''}" for name, count in counts if count)


def _log(news: list[Diagnostic]) -> None:
    import logging

    logger = logging.getLogger(LOGGER)
    if not any(isinstance(handler, logging.NullHandler) for handler in logger.handlers):
        logger.addHandler(logging.NullHandler())  # without a handler, records would also go to stderr, beside the warning
    levels = {Severity.ERROR: logging.ERROR, Severity.WARNING: logging.WARNING}
    for d in news:
        about: dict[str, Any] = {"code": d.code, "prim_path": d.prim_path, "attribute": d.attribute, "kind": d.kind.value}
        what = f"{d.attribute}: {d.message}" if d.attribute else d.message
        place = f" [{d.prim_path}]" if d.prim_path else ""
        logger.log(levels[d.severity], "%s: %s%s", d.code, what, place, extra=about)


def _levels_to_caller() -> int:
    """Return the caller's `stacklevel` of the nearest frame outside primray, so that the warning names the user's line."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] == "primray":
        level, frame = level + 1, frame.f_back
    return level
