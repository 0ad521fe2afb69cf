"""Rendering of a frame whose samples an executor renders in parts, with the results and errors of `render`."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

from ..diagnostic_codes import Severity
from ..errors import RenderCancelled, SettingsError
from ..settings import RenderSettings
from ..settings.stage_settings import STOPS
from .interruption import interruption

if TYPE_CHECKING:
    from ..diagnostics import Diagnostic, Diagnostics
    from ..distributed.executor import PartsExecutor
    from ..images.image import Image
    from ..sampling.sampling import Progress

ENDS = (*STOPS, "error_metric", "denoise")


def render_in_parts(
    stage: str | os.PathLike[str] | Any,
    settings: RenderSettings,
    executor: PartsExecutor,
    progress: Progress | None,
    on_interrupt: Literal["raise", "partial"],
) -> Image:
    """Render a frame in parts.

    As in `render`, KeyboardInterrupt or RenderCancelled where it was stopped, unless the partial picture is wanted.
    """
    from ..distributed.gather import gather
    from ..report.report import Costs

    if not isinstance(stage, str | os.PathLike):
        raise SettingsError("rendering in parts needs the stage's path", where="stage", code="parts-setting")
    settings, notes = with_ends_of_stage(os.fspath(stage), settings)
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
    known = image.report["diagnostics"]
    rows = [*known, *(row for row in (note.as_json() for note in notes) if row not in known)]
    image = replace(image, report={**image.report, "diagnostics": rows})
    if image.report["interrupted"] and on_interrupt == "raise":
        if stopped:
            raise RenderCancelled("the render was stopped by its progress callback")
        raise KeyboardInterrupt
    return image


def with_ends_of_stage(stage: str, settings: RenderSettings) -> tuple[RenderSettings, Diagnostics]:
    """Return the settings with the stage's stopping rules, where they leave these open, and diagnostics.

    Parts are ranges of samples, so the rules must be known before there are any. Parts read all other settings from the stage.
    """
    from .. import usd
    from ..diagnostics import Diagnostics
    from .prepare import open_once, with_stage_settings

    notes = Diagnostics()
    if settings.stops_early or settings.spp is not None:
        return settings, notes
    found = usd.products(open_once(stage, settings).stage, settings)
    product = found[0]
    if settings.product is not None:
        path = usd.named_product(settings.product, [each.path for each in found])
        product = next(each for each in found if each.path == path)
    asked = replace(product.asked, asked=tuple(one for one in product.asked.asked if one.name in ENDS))
    return with_stage_settings(settings, asked, notes)[0], notes


def diagnostics_of(image: Image) -> list[Diagnostic]:
    """Return the diagnostics of a frame's parts, which have not been reported to the user yet."""
    from ..diagnostics import Diagnostic

    names = ("code", "prim_path", "message", "attribute")
    return [
        Diagnostic(Severity(row["severity"]), **{name: row.get(name, "") for name in names})
        for row in image.report["diagnostics"]
    ]
