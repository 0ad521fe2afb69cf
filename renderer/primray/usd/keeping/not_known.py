"""Signal that the effect of an edit is not known: everything is translated again."""

from __future__ import annotations


class NotKnownError(Exception):
    """Raised inside this package only; never shown to users."""
