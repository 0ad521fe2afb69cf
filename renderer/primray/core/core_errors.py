"""Errors of the core, raised as errors of primray."""

from __future__ import annotations

from typing import NoReturn

from .. import errors


def raise_as_ours(error: Exception) -> NoReturn:
    """Raise the PrimrayError that corresponds to a CoreError."""
    code, message = error.args
    if code in ("out-of-memory", "too-large"):
        raise errors.LimitError(message, code=code) from error
    if code == "settings-error":
        raise errors.SettingsError(message) from error
    raise errors.InternalError(message, code=code) from error
