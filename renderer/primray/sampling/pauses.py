"""Saving in the middle of a render: sampling pauses meanwhile, which changes no bit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from .sampling import Progress, Sampling


class Saving(Protocol):
    """Something that is saved at intervals."""

    def is_due(self) -> bool: ...

    def save_meanwhile(self, sampling: Sampling) -> None: ...


def run(sampling: Sampling, progress: Progress | None, savings: Sequence[Saving]) -> None:
    """Sample until a stopping rule applies, and save what is due in between."""
    pause = (lambda: any(saving.is_due() for saving in savings)) if savings else None
    while not sampling.run(progress, pause):
        for saving in savings:
            if saving.is_due():
                saving.save_meanwhile(sampling)
