"""An opened stage with what its renders leave to the next: it listens to edits, and forgets what was left half made."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..render.prepare import OpenedStage, open_once, prepare
from ..render.render import OnInterrupt, render_opened
from .frugal_steps import FrugalSteps
from .kept_steps import KeptSteps

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..checkpoints.checkpointing import Checkpointing
    from ..diagnostics import Diagnostics
    from ..images.image import Image
    from ..render.render import Tell
    from ..render.snapshots import Snapshots
    from ..report.prepared import Prepared
    from ..report.report import Costs
    from ..sampling.sampling import Progress
    from ..settings import RenderSettings


class KeptStage:
    """`opened`: the stage, as it was composed for the settings it was opened with. `most_memory`: a part of the machine's;
    where the process has more, nothing is kept beside the picture that is rendered."""

    def __init__(self, stage: Any, settings: RenderSettings, *, most_memory: float | None = None) -> None:
        from ..usd.keeping import StageChanges

        self._composition = settings.composition
        self.opened = stage if isinstance(stage, OpenedStage) else open_once(stage, settings)
        self._changes = StageChanges(self.opened.stage)
        self._steps = KeptSteps() if most_memory is None else FrugalSteps(most_memory)
        self._is_told = False  # how long opening took

    def forget(self) -> None:
        self._steps.forget()

    def prepare(
        self, settings: RenderSettings, costs: Costs, diagnostics: Diagnostics, *, fingerprinted: bool = False
    ) -> Prepared:
        """As render.prepare."""
        self._catch_up(costs)
        stage, opening = self.opened.stage, self.opened.diagnostics
        with self._steps.whole():
            return prepare(stage, opening, settings, costs, diagnostics, fingerprinted=fingerprinted, steps=self._steps)

    def render(
        self,
        settings: RenderSettings,
        progress: Progress | None,
        on_interrupt: OnInterrupt,
        checkpointing: Checkpointing | None,
        snapshots: Sequence[Snapshots],
        tell: Tell,
    ) -> Image:
        """As render.render_opened."""
        from ..report.report import Costs

        costs = Costs()
        self._catch_up(costs)
        with self._steps.whole():
            return render_opened(
                self.opened, settings, costs, progress, on_interrupt, checkpointing, snapshots, tell, self._steps
            )

    def _catch_up(self, costs: Costs) -> None:
        """With edits, of which opening may have something else to tell."""
        if not self._is_told:
            costs.stages_s["open"], self._is_told = self.opened.seconds, True
        changes = self._changes.take()
        self._steps.changes.add(changes)
        if changes.others:
            from ..diagnostics import Diagnostics
            from ..usd.opening.stage import check_again

            told = Diagnostics()
            with costs.stage("open"):
                check_again(self.opened.stage, told, self._composition)
            self.opened = replace(self.opened, diagnostics=told)
