"""Notebook support: detection of a notebook, and HTML of a picture with its diagnostics and of a progress bar.

IPython is used if it is already imported, and never imported otherwise.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any

from .diagnostics_text import diagnostics_lines

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
