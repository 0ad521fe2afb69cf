"""The stage of a job's frames, opened once for those that one worker renders."""

from __future__ import annotations

import os
from pathlib import Path

from primray.render.prepare import OpenedStage, composing_settings, open_once
from primray.report.report import Costs
from primray.settings import RenderSettings

KEPT_PART = 0.125  # of the memory allowed: of a larger process it goes before sampling begins, as that of a single frame does


class KeptStage:
    def __init__(self) -> None:
        self._opened: OpenedStage | None = None
        self._file = ""

    def open(self, file: str, settings: RenderSettings, costs: Costs) -> OpenedStage:
        found, self._opened = self._opened, None
        if found is None or (self._file, found.composed_by) != (file, composing_settings(settings)):
            with costs.stage("open"):
                found = open_once(file, settings)
        if settings.max_memory_bytes is None or _resident_bytes() <= KEPT_PART * settings.max_memory_bytes:
            self._opened, self._file = found, file
        return found


def _resident_bytes() -> float:
    try:
        return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:  # there is no /proc
        return float("inf")
