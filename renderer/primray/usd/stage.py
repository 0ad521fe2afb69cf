"""Opening a stage: a path or a Usd.Stage in memory; what USD complains about becomes errors and diagnostics.

USD's messages may hold bytes that are not UTF-8 (they quote the file), so they are read through `error_text`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from pxr import Tf, Usd, UsdUtils

from ..diagnostics import Diagnostics
from ..errors import StageOpenError


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


@contextmanager
def usd_messages(diagnostics: Diagnostics, known: Callable[[str], bool] = lambda text: False) -> Iterator[None]:
    """Keep USD's warnings off stderr and record those that `known` does not cover as diagnostics."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        for message in delegate.TakeUncoalescedDiagnostics():
            text = error_text(message, "commentary").strip()
            if text and not known(text):
                diagnostics.add("usd-message", "", text)
        del delegate


def open_stage(source: str | os.PathLike[str] | Usd.Stage, diagnostics: Diagnostics) -> Usd.Stage:
    """The composed stage; StageOpenError when there is none."""
    composed: list[str] = []
    with usd_messages(diagnostics, lambda text: any(line in text for line in composed)):
        stage = source if isinstance(source, Usd.Stage) else _open(os.fspath(source))
        for error in stage.GetCompositionErrors():
            text = error_text(error)
            composed.append(text)
            diagnostics.add("composition-error", _site(error), text)
    return stage


def _open(path: str) -> Usd.Stage:
    if not os.path.exists(path) and "[" not in path and "://" not in path:
        raise StageOpenError("There is no such file.", where=path)
    try:
        stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        raise StageOpenError(f"USD cannot open it: {tf_message(error)}", where=path) from None
    except UnicodeError:
        raise StageOpenError("The path is not valid text.", where=repr(path)) from None
    if stage is None:
        raise StageOpenError("USD cannot open it.", where=path)
    return stage


def _site(error: Any) -> str:
    try:
        return str(error.rootSite.path)
    except (AttributeError, UnicodeDecodeError):
        return ""
