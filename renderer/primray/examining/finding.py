"""A finding of an examination: one reason, the prims that it concerns, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any


class Question(Enum):
    """Questions about a picture, in the order in which answers are given."""

    EMPTY = "empty"  # why is something, or everything, not there?
    DARK = "dark"  # why is it too dark, or too bright?
    GREY = "grey"  # why has it no colour?
    SLOW = "slow"  # what takes the time: setting up, tracing, or noise?


@dataclass(frozen=True)
class Finding:
    """A reason for what is wrong. `share` (0 to 1) is the fraction of pixels, seconds or error that it explains, if known."""

    question: Question
    code: str
    message: str
    advice: str
    prims: tuple[str, ...] = ()
    share: float | None = None

    def as_json(self) -> dict[str, Any]:
        return {
            "question": self.question.value,
            "code": self.code,
            "message": self.message,
            "advice": self.advice,
            "prims": list(self.prims),
            "share": self.share,
        }
