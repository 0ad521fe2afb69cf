"""Stages of a contact sheet on the nodes of a Ray cluster: packed here, each rendered by one of them; its files come back."""

from __future__ import annotations

import json
import time
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from ..distributed.executor import PartLost
from ..errors import PrimrayError, SettingsError
from ..settings import RenderSettings
from .sheet_renders import LIMIT_S, Limits, Outcome, marks

GROUP, NAME = "primray.executors", "ray-stages"
ATTEMPTS = 3  # of a stage whose node is lost
FILES = ("p.exr", "p.png", "r.json")


@dataclass(frozen=True)
class RemoteEnd:
    """How the process of a stage on another machine ended; its files are in the folder that was asked for."""

    exit_code: int  # negative: killed by that signal
    peak_rss_bytes: int
    message: str


class StagesExecutor(AbstractContextManager["StagesExecutor"], Protocol):
    """Renders whole pictures of stages elsewhere; `render` is called by many threads at once."""

    def slots(self) -> int:
        """Return how many stages can be rendered at a time."""

    def render(
        self, stage: Path, settings: RenderSettings, names: tuple[str, ...], folder: Path, timeout_s: float, memory_bytes: int
    ) -> RemoteEnd:
        """Render and write the files of these names. TimeoutError, PartLost if another attempt may help, or PrimrayError."""


def ray_stages(address: str) -> StagesExecutor:
    """Return the executor for the Ray cluster at `address`, which connects as it is entered. SettingsError if there is none."""
    from importlib.metadata import entry_points

    for entry in entry_points(group=GROUP, name=NAME):
        made: StagesExecutor = entry.load()(address)
        return made
    raise SettingsError("--ray needs the render service: pip install 'primray[server,ray]'", code="ray-missing")


@dataclass(frozen=True)
class RaySheet:
    """Renders stages of a sheet as `render_stage` does, with these settings."""

    executor: StagesExecutor
    settings: RenderSettings

    def render(self, folder: Path, stage: Path, limits: Limits, scratch: Path) -> Outcome:
        scratch.mkdir(parents=True, exist_ok=True)
        begun, exit_code, peak, message = time.monotonic(), 1, 0, ""
        ended: int | str
        for _ in range(ATTEMPTS):
            try:
                found = self.executor.render(stage, self.settings, FILES, scratch, limits.timeout_s, limits.memory_bytes)
                ended, peak, message = found.exit_code, found.peak_rss_bytes, found.message
            except PartLost as lost:
                ended, message = exit_code, f"error: {lost}"
                continue
            except TimeoutError:
                ended = LIMIT_S
            except PrimrayError as error:
                ended, message = error.exit_code, f"error: {error}"
            break
        exr, png, report_file = (scratch / name for name in FILES)
        report = json.loads(report_file.read_text(encoding="utf-8")) if report_file.exists() else {}
        return Outcome(
            stage=stage.relative_to(folder).as_posix(),
            exit_code=ended,
            seconds=time.monotonic() - begun,
            peak_rss_bytes=peak,
            picture=str(png) if png.exists() else None,
            message=message if ended != 0 else "",
            marks=tuple(marks(ended, exr, report)),
            report=report,
        )
