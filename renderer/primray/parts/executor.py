"""Where parts of a frame are rendered: the interface that gather.py uses.

A part is a render of some of each pixel's samples (`RenderSettings.sample_range`) that leaves a checkpoint. At-least-once: a
part that was lost is given out again, and a file that comes for one that was cancelled is not used.
"""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path
from typing import Protocol

from ..settings import RenderSettings


class PartLost(Exception):
    """Whatever rendered the part has died, or its machine: another may do it."""


class PartsExecutor(Protocol):
    """Methods are called by one thread."""

    def begin(self, stage: str) -> None:
        """Parts of the stage with this path follow. PrimrayError where none could be rendered, saying why."""

    def slots(self) -> int:
        """Parts at a time; may change, and is 0 while there is nowhere to render them."""

    def submit(self, settings: RenderSettings, file: Path) -> Future[None]:
        """Render the part and leave its checkpoint at `file`, as a whole, before the future is done.

        PartLost in the future where another try may help; any other error is the frame's. Cancelling it ends the work.
        """

    def end(self) -> None:
        """No more of this stage; what runs is ended."""
