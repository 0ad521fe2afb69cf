"""What is done in the middle of a render, with the samples so far: sampling pauses for it, which changes no bit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from .sampling import Progress, Sampling


class Saving(Protocol):
    """Something to be saved every so often."""

    def is_due(self) -> bool: ...

    def save_meanwhile(self, sampling: Sampling) -> None: ...


def run(sampling: Sampling, progress: Progress | None, savings: Sequence[Saving]) -> None:
    """Sample until something stops it; whatever is due by then is saved on the way."""
    pause = (lambda: any(saving.is_due() for saving in savings)) if savings else None
    while not sampling.run(progress, pause):
        for saving in savings:
            if saving.is_due():
                saving.save_meanwhile(sampling)
