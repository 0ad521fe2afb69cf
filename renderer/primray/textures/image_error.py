"""Why OpenImageIO could not read or write something: its messages quote the file, whose bytes need not be text."""

from __future__ import annotations

from typing import Any


def last_error(source: Any) -> str:
    """Of OpenImageIO itself or one of its objects, on one line; forgotten there afterwards."""
    try:
        return "; ".join(map(str.strip, str(source.geterror()).strip().splitlines()))
    except UnicodeDecodeError:
        return "its header holds bytes that are no text"
