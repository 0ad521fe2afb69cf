"""What USD says when it fails. Its messages may hold bytes that are not UTF-8 (they quote the file), so they are read here."""

from __future__ import annotations

from typing import Any

from pxr import Tf


def error_text(message: Any, field: str = "") -> str:
    """The text of one of USD's messages or of its `field`, with bytes that are not UTF-8 replaced."""
    try:
        return str(getattr(message, field) if field else message)
    except UnicodeDecodeError as error:
        return error.object.decode("utf-8", "replace")


def tf_message(error: Tf.ErrorException) -> str:
    """What went wrong, without USD's source locations."""
    texts = [error_text(part, "commentary" if hasattr(type(part), "commentary") else "") for part in error.args]
    return "; ".join(dict.fromkeys(text.strip() for text in texts)) or "unknown USD error"
