"""Cursors of pages: the last row's time and id, in an opaque form."""

from __future__ import annotations

import base64
import json
import math


def write_cursor(at: float, row_id: str, order: str) -> str:
    """Return a cursor; `order` names the listing, so that a cursor is not used in another."""
    return base64.urlsafe_b64encode(json.dumps([at, row_id, order]).encode()).decode().rstrip("=")


def read_cursor(cursor: str, order: str) -> tuple[float, str]:
    """Return time and id; ValueError for a cursor of another listing."""
    try:
        at, row_id, of = json.loads(base64.b64decode(cursor + "=" * (-len(cursor) % 4), altchars=b"-_", validate=True))
        is_one = (
            of == order
            and type(at) in (int, float)
            and math.isfinite(at)
            and isinstance(row_id, str)
            and row_id.isascii()
            and row_id.isprintable()
        )
    except (ValueError, TypeError, RecursionError):
        is_one = False
    if not is_one:
        raise ValueError("The cursor is not from this listing.")
    return float(at), row_id
