"""Messages to the user: diagnostics as text, as Python warnings and log records, and as HTML in notebooks.

Text is grouped by severity, kind, code and attribute, worst first, with the first few prims of each group. A message that many
prims share is printed once; of messages that differ from prim to prim, the first few. JSON has them all. In a frame sequence,
each is shown at the first frame that has it, and counted in the others.

Callers of the library get one Python warning per render, and a `logging` record for each diagnostic; the command line and the
service show diagnostics themselves and announce nothing. IPython is used where it is imported already, and never imported.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping
from importlib import import_module
from typing import Any

from .diagnostic_codes import Kind, Severity
from .diagnostics import Diagnostic

_ORDER = ("error", "warning", "info")
_KINDS = tuple(kind.value for kind in Kind)
_PRIMS_SHOWN = 3
_MESSAGES_SHOWN = 3

Row = Mapping[str, str]
Key = tuple[str, str, str, str]  # severity, kind, code, attribute
CountKey = tuple[str, str, str]
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def print_diagnostics(diagnostics: Iterable[Row], *, verbose: bool) -> None:
    """Print diagnostics to stderr; stdout is reserved for requested output."""
    for line in diagnostics_lines(diagnostics, verbose=verbose):
        print(line, file=sys.stderr)


def diagnostics_lines(diagnostics: Iterable[Row], *, verbose: bool = False) -> list[str]:
    """Return lines of text for diagnostics in their JSON form, with all messages and prims if `verbose`."""
    groups: dict[Key, dict[str, list[Row]]] = {}
    for row in diagnostics:
        key = (row["severity"], row.get("kind", ""), row["code"], row.get("attribute", ""))
        groups.setdefault(key, {}).setdefault(row["message"], []).append(row)
    lines = []
    for key, messages in sorted(groups.items(), key=lambda item: _rank(item[0])):
        lines += _group(key, messages, verbose)
    return lines


def fidelity_text(diagnostics: Iterable[Row]) -> str:
    """Return one line counting the warnings and errors of each kind that changes the picture."""
    counts = Counter(row["kind"] for row in diagnostics if row["severity"] != "info")
    told = [f"{counts[kind.value]:,} {kind.value}" for kind in Kind if kind.changes_picture and counts[kind.value]]
    return ", ".join(told) or "as authored"


def _rank(key: Key) -> tuple[int, int, str, str]:
    severity, kind, code, attribute = key
    return _ORDER.index(severity), _KINDS.index(kind) if kind in _KINDS else len(_KINDS), code, attribute


def _group(key: Key, messages: dict[str, list[Row]], verbose: bool) -> list[str]:
    severity, kind, code, attribute = key
    head = f"{severity}: {code}{f' ({kind})' if kind and kind != code else ''}: "
    shown = list(messages.items()) if verbose else list(messages.items())[:_MESSAGES_SHOWN]
    lines = []
    for message, rows in shown:
        times = f" ({len(rows):,} times)" if len(rows) > 1 else ""
        lines.append(f"{head}{_sentence(attribute, message)}{times}")
        lines += _prims(rows, verbose)
    left = [row for rows in list(messages.values())[len(shown) :] for row in rows]
    if left:
        lines.append(f"{head}{f'{attribute}: ' if attribute else ''}and {len(left):,} more of this kind")
        lines += _prims(left, verbose)
    return lines


def _sentence(attribute: str, message: str) -> str:
    """Return the message prefixed with its attribute, merged if it begins with the attribute's name.

    "roughness = 3 is .." becomes "inputs:roughness = 3 is ..".
    """
    if message.startswith(attribute):  # always true for ""
        return message
    name = attribute.rpartition("inputs:")[2]
    return f"{attribute}{message.removeprefix(name)}" if message.startswith(f"{name} ") else f"{attribute}: {message}"


def _prims(rows: list[Row], verbose: bool) -> list[str]:
    paths = list(dict.fromkeys(row["prim_path"] for row in rows if row["prim_path"]))
    shown = paths if verbose else paths[:_PRIMS_SHOWN]
    more = f" and {len(paths) - len(shown):,} more" if len(paths) > len(shown) else ""
    return [f"    {', '.join(shown)}{more}"] if shown else []


class SequenceNotices:
    """Diagnostics shown so far in a sequence.

    Rows are diagnostics in their JSON form; a frame may have several renders, for products or for two eyes.
    """

    def __init__(self) -> None:
        self._shown: set[tuple[str, ...]] = set()
        self._frames: defaultdict[CountKey, set[Hashable]] = defaultdict(set)
        self._all: set[Hashable] = set()

    def new(self, rows: Iterable[Row], frame: Hashable) -> list[Row]:
        """Return the rows of another render of `frame` that no earlier render had.

        Rows are the same if prim, attribute and code are, whatever the message says.
        """
        rows = list(rows)
        self._all.add(frame)
        for row in rows:
            self._frames[row["severity"], row["code"], row.get("kind", "")].add(frame)
        new = [row for row in rows if _identity(row) not in self._shown]
        self._shown.update(map(_identity, rows))
        return new

    def lines(self) -> list[str]:
        """Return a line for each warning and error with the number of frames concerned; nothing for a single frame."""
        if len(self._all) < 2:
            return []
        return [
            f"{severity}: {code}{f' ({kind})' if kind else ''}: in {len(frames):,} of {len(self._all):,} frames"
            for (severity, code, kind), frames in sorted(self._frames.items())
            if severity != "info"
        ]


def _identity(row: Row) -> tuple[str, ...]:
    place = row["prim_path"], row.get("attribute", "")
    if any(place):
        return row["severity"], row["code"], *place
    # Choices made per frame differ only in their numbers, such as a turntable's degrees.
    message = _NUMBER.sub("#", row["message"]) if row["severity"] == "info" else row["message"]
    return row["severity"], row["code"], message


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


def without_place(warning: str) -> str:
    """Return the lines of an announced warning alone, as the command line prints diagnostics."""
    return "\n".join(line.removeprefix("  ") for line in warning.split("\n")[1:])


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


_COLORS = {"error": "#b3261e", "warning": "#8a5a00"}


def in_notebook() -> bool:
    """Return whether this runs in an IPython kernel, whose front end shows HTML. IPython in a terminal does not count."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return hasattr(shell, "kernel")


def display(shown: object, **options: Any) -> Any:
    """Call IPython's `display` in a notebook, and return its handle if `display_id` is given."""
    return import_module("IPython.display").display(shown, **options)


class Html:
    """HTML text that a front end shows as it is."""

    def __init__(self, text: str, plain: str = "") -> None:
        self.text = text
        self.plain = plain

    def _repr_html_(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return self.plain


def picture_html(png: Callable[[], bytes], resolution: tuple[int, int], diagnostics: Iterable[Mapping[str, str]]) -> str | None:
    """Return the picture with its warnings and errors below it, or None if there are none and the picture suffices."""
    told = [row for row in diagnostics if row["severity"] != "info"]
    if not told:
        return None
    from base64 import b64encode

    source = b64encode(png()).decode("ascii")
    width, height = resolution
    image = (
        f'<img src="data:image/png;base64,{source}" width="{width}" height="{height}" style="max-width: 100%; height: auto">'
    )
    return f"<div>{image}{diagnostics_html(told)}</div>"


def diagnostics_html(diagnostics: Iterable[Mapping[str, str]]) -> str:
    """Return the warnings and errors among the diagnostics as HTML, one per line, or ""."""
    items = "".join(map(_line_html, diagnostics_lines(row for row in diagnostics if row["severity"] != "info")))
    return f'<div style="font-family: monospace; white-space: pre-wrap; margin-top: 0.5em">{items}</div>' if items else ""


def _line_html(line: str) -> str:
    from html import escape

    color = _COLORS.get(line.partition(":")[0], "inherit")
    return f'<div style="color: {color}">{escape(line)}</div>'


def bar_html(fraction: float, said: str) -> str:
    from html import escape

    percent = 100 * min(max(fraction, 0.0), 1.0)
    return (
        f'<progress max="100" value="{percent:.1f}" style="width: 20em; vertical-align: middle"></progress> '
        f'<span style="font-family: monospace">{percent:3.0f} % {escape(said)}</span>'
    )
