"""What an edit leads to where it is not known what follows from it: everything is translated again."""

from __future__ import annotations


class NotKnownError(Exception):
    """Never shown to anybody."""
