"""A frame whose samples an executor renders in parts: prepared nowhere here, and told as a render that was."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Literal

from ..diagnostic_codes import Severity
from ..errors import RenderCancelled, SettingsError
from ..settings import RenderSettings
from .interruption import interruption

if TYPE_CHECKING:
    from ..diagnostics import Diagnostic
    from ..images.image import Image
    from ..parts.executor import PartsExecutor
    from ..sampling.sampling import Progress


def render_in_parts(
    stage: str | os.PathLike[str] | Any,
    settings: RenderSettings,
    executor: PartsExecutor,
    progress: Progress | None,
    on_interrupt: Literal["raise", "partial"],
) -> Image:
    """As `render`: KeyboardInterrupt or RenderCancelled where it was stopped, unless its picture so far is wanted."""
    from ..parts.gather import gather
    from ..report.report import Costs

    if not isinstance(stage, str | os.PathLike):
        raise SettingsError("parts are rendered of a stage's file: give its path", where="stage", code="parts-setting")
    stopped = False

    def watched(fraction: float, samples: int, rays: int) -> bool:
        nonlocal stopped
        stopped = stopped or (progress is not None and progress(fraction, samples, rays) is False)
        return not stopped and not asked.asked

    with interruption() as asked:
        try:
            image = gather(executor, os.fspath(stage), settings, Costs(), watched).image
        except RenderCancelled:
            if stopped:
                raise
            raise KeyboardInterrupt from None
    if image.report["interrupted"] and on_interrupt == "raise":
        if stopped:
            raise RenderCancelled("the render was stopped by its progress callback")
        raise KeyboardInterrupt
    return image


def diagnostics_of(image: Image) -> list[Diagnostic]:
    """Those of its parts, which no machine has told yet."""
    from ..diagnostics import Diagnostic

    names = ("code", "prim_path", "message", "attribute")
    return [
        Diagnostic(Severity(row["severity"]), **{name: row.get(name, "") for name in names})
        for row in image.report["diagnostics"]
    ]
