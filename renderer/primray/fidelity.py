"""In what way a picture may differ from what its stage says; diagnostic_codes.py says it of each code."""

from __future__ import annotations

from enum import Enum


class Kind(Enum):
    """In what way the picture keeps to the stage, worst first."""

    MISSING = "missing"  # a part of the picture, or of the input, is not there
    IGNORED = "ignored"  # something authored has no effect
    APPROXIMATED = "approximated"  # honoured, not exactly
    OUT_OF_RANGE = "out-of-range"  # a value that is not allowed: the nearest allowed one is used
    DEFAULTED = "defaulted"  # a value that cannot be used, or none where one is needed: the default is used
    CHOSEN = "chosen"  # the stage leaves something open: a choice was made
    NOTE = "note"  # the picture is as the stage says

    @property
    def changes_picture(self) -> bool:
        return self not in (Kind.CHOSEN, Kind.NOTE)
