"""Kinds of difference between a picture and what its stage specifies; diagnostic_codes.py assigns one to each code."""

from __future__ import annotations

from enum import Enum


class Kind(Enum):
    """How a picture deviates from its stage, worst first."""

    MISSING = "missing"  # a part of the picture, or of the input, is missing
    IGNORED = "ignored"  # an authored opinion has no effect
    APPROXIMATED = "approximated"  # an authored opinion is honoured, but not exactly
    OUT_OF_RANGE = "out-of-range"  # a value is not allowed: the nearest allowed value is used
    DEFAULTED = "defaulted"  # a value is unusable or missing: the default is used
    CHOSEN = "chosen"  # the stage leaves something open: primray chose
    NOTE = "note"  # the picture is what the stage specifies

    @property
    def changes_picture(self) -> bool:
        return self not in (Kind.CHOSEN, Kind.NOTE)
