"""Interface of executors, which render the parts of a distributed frame.

A part is a render of some of each pixel's samples (`RenderSettings.sample_range`) that writes a checkpoint. Delivery is at
least once: a lost part is submitted again, and the file of a cancelled one is ignored.
"""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path
from typing import Protocol

from ..settings import RenderSettings


class PartLost(Exception):
    """The process or machine that rendered a part died; the part may be submitted again."""


class PartsWithdrawn(Exception):
    """Parts that were accepted before are not to be believed, as their worker was found out: the frame begins again."""


class PartsExecutor(Protocol):
    """Renders parts of one frame at a time; methods are called from one thread."""

    def begin(self, stage: str) -> None:
        """Prepare for parts of the stage at this path. PrimrayError, with the reason, if none can be rendered."""

    def slots(self) -> int:
        """Return how many parts can run at a time; may change, and is 0 while no part can run."""

    def submit(self, settings: RenderSettings, file: Path) -> Future[None]:
        """Render the part and write its complete checkpoint to `file` before the future is done.

        The future raises PartLost if another attempt may help, and PartsWithdrawn if the whole frame must begin again; any
        other error ends the frame. Cancelling it stops the work.
        """

    def end(self) -> None:
        """Stop running parts; no more of this stage follow."""
