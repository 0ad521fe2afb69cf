"""The stage of a job's frames, opened once for those that one worker renders; what frames have in common is reused."""

from __future__ import annotations

from primray.diagnostics import Diagnostics
from primray.incremental.scene import KeptStage
from primray.incremental.steps import KEPT_PART
from primray.process_memory import resident_bytes
from primray.render import Prepared, prepare
from primray.render.prepare import OpenedStage, composing_settings
from primray.report.report import Costs
from primray.settings import RenderSettings


class StageOfFrames:
    """The open stage. Create it before the stage is opened: memory in use by then, mostly libraries, does not count as the
    stage's."""

    def __init__(self) -> None:
        self._kept: KeptStage | None = None
        self._file = ""
        self._bytes_before = resident_bytes()

    def prepare(
        self, file: str, settings: RenderSettings, costs: Costs, diagnostics: Diagnostics, *, more_follow: bool
    ) -> Prepared:
        """Prepare a frame like render.prepare, for a checkpoint. Nothing is kept of the last frame beyond itself."""
        found, self._kept = self._kept, None
        if found is None or not self._has(found, file, settings):
            with costs.stage("open"):
                found = KeptStage(file, settings)
            if not more_follow:
                opened = found.opened
                return prepare(opened.stage, opened.diagnostics, settings, costs, diagnostics, fingerprinted=True)
        prepared = found.prepare(settings, costs, diagnostics, fingerprinted=True)
        if more_follow and self._is_small(settings.max_memory_bytes):
            self._kept, self._file = found, file
        return prepared

    def opened(self, file: str, settings: RenderSettings, costs: Costs) -> OpenedStage:
        """Return the stage, which the next `prepare` uses."""
        if self._kept is None or not self._has(self._kept, file, settings):
            self._kept = None
            with costs.stage("open"):
                self._kept, self._file = KeptStage(file, settings), file
        return self._kept.opened

    def _has(self, found: KeptStage, file: str, settings: RenderSettings) -> bool:
        return (self._file, found.opened.composed_by) == (file, composing_settings(settings))

    def _is_small(self, most_bytes: int | None) -> bool:
        return most_bytes is None or resident_bytes() - self._bytes_before <= KEPT_PART * most_bytes
