"""What the core raises, as an error of primray."""

from __future__ import annotations

from typing import NoReturn

from .. import errors


def raise_as_ours(error: Exception) -> NoReturn:
    code, message = error.args
    if code in ("out-of-memory", "too-large"):
        raise errors.LimitError(message, code=code) from error
    if code == "settings-error":
        raise errors.SettingsError(message) from error
    raise errors.InternalError(message, code=code) from error
