"""Texts of USD's errors. They may hold bytes that are not UTF-8 (they quote files), so they are decoded here."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pxr import Tf

from ...errors import InvalidSceneError

_BREAK = re.compile(r"\s*\n\s*([;,.]?)")  # USD quotes errors that end their line in the middle of a sentence


def error_text(message: Any, field: str = "") -> str:
    """Return the text of one of USD's messages, or of its `field`, on one line, with bytes that are not UTF-8 replaced."""
    try:
        text = str(getattr(message, field) if field else message)
    except UnicodeDecodeError as error:
        text = error.object.decode("utf-8", "replace")
    return _BREAK.sub(lambda found: found[1] or " ", text.strip())


def tf_message(error: Tf.ErrorException) -> str:
    """Return what went wrong, without USD's source locations, and without sentences that another one repeats."""
    texts = [error_text(part, "commentary" if hasattr(type(part), "commentary") else "") for part in error.args]
    told = [text for text in dict.fromkeys(texts) if not any(text in other for other in texts if other != text)]
    return "; ".join(told) or "unknown USD error"


@contextmanager
def scene_errors() -> Iterator[None]:
    """Raise InvalidSceneError where USD fails in a call that is not guarded, such as for a prim whose name is not text."""
    try:
        yield
    except Tf.ErrorException as error:
        raise InvalidSceneError(f"USD cannot read the stage: {tf_message(error)}", code="damaged-stage") from error
    except UnicodeDecodeError as error:
        raise InvalidSceneError(f"The stage holds a name that is not UTF-8: {error.object!r}", code="damaged-stage") from error
