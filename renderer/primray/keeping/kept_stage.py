"""An opened stage with results that its next render can reuse: it follows edits, and drops results of interrupted steps."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..render.prepare import prepare
from ..render.render import OpenedFrames
from .frugal_steps import FrugalSteps
from .kept_steps import KeptSteps

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..diagnostics import Diagnostics
    from ..render.steps import Steps
    from ..report.prepared import Prepared
    from ..report.report import Costs
    from ..settings import RenderSettings


class KeptStage(OpenedFrames):
    """An opened stage and its kept steps. `opened`: the stage, as composed for the settings that it was opened with.

    `is_frugal`: where the process is large, nothing is kept beside the picture that is rendered.
    """

    def __init__(self, stage: Any, settings: RenderSettings, *, is_frugal: bool = False) -> None:
        from ..usd.keeping import StageChanges

        super().__init__(stage, settings)
        self._composition = settings.composition
        self._is_given = self.opened.stage is stage  # a caller's stage, whose session layer primray does not write to
        self._changes = StageChanges(self.opened.stage)
        self._steps = FrugalSteps() if is_frugal else KeptSteps()

    def forget(self) -> None:
        self._steps.forget()

    @contextmanager
    def steps(self, costs: Costs) -> Iterator[Steps]:
        with super().steps(costs):
            self._catch_up(costs)
            with self._steps.whole():
                yield self._steps

    def prepare(
        self, settings: RenderSettings, costs: Costs, diagnostics: Diagnostics, *, fingerprinted: bool = False
    ) -> Prepared:
        """Prepare a render, as render.prepare does."""
        with self.steps(costs) as steps:
            stage, opening = self.opened.stage, self.opened.diagnostics
            return prepare(stage, opening, settings, costs, diagnostics, fingerprinted=fingerprinted, steps=steps)

    def _catch_up(self, costs: Costs) -> None:
        """Take the edits since the last render; after edits of the composition, repeat the checks of opening."""
        if not self._is_given:
            from ..usd.opening.session_layer import follow_session_layers

            follow_session_layers(self.opened.stage)
        changes = self._changes.take()
        self._steps.changes.add(changes)
        if changes.others:
            from ..diagnostics import Diagnostics
            from ..usd.opening.stage import check_again

            told = Diagnostics()
            with costs.stage("open"):
                check_again(self.opened.stage, told, self._composition)
            self.opened = replace(self.opened, diagnostics=told)
