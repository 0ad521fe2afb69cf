"""Prediction of the samples and seconds that an error costs: `primray estimate` and `primray.estimate`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack

from ..render.render import with_setting_names
from ..settings import Metric, RenderSettings, with_values
from .doctor import PILOT_S, SMALLEST_TARGET, check_pilot

if TYPE_CHECKING:
    from ..diagnostics import Diagnostic
    from ..sampling.error import Estimate
    from ..sampling.prediction import Prediction
    from ..settings.written import SettingsValues


@dataclass(frozen=True, kw_only=True)
class CostEstimate:
    """Measurements of a pilot of a few seconds, and the samples and seconds that it predicts for each target error.

    >>> cost = primray.estimate("shot.usda", [0.05], resolution=(32, 18), pilot_seconds=0.1)
    >>> cost.metric, cost.samples > 0, [prediction.target for prediction in cost.predictions]
    (<Metric.RELMSE: 'relmse'>, True, [0.05])

    A prediction's `samples` per pixel and `seconds` have a `value` and the ends of its 95 % interval, `low` and `high`; they
    are None where more samples are needed than are allowed.
    """

    metric: Metric
    samples: float  # per pixel, of the pilot
    seconds: float  # of the pilot's sampling
    error: Estimate  # at the pilot's end
    predictions: tuple[Prediction, ...]  # empty where the picture has no visible error
    diagnostics: tuple[Diagnostic, ...]

    def as_json(self) -> dict[str, Any]:
        """Return what `primray estimate --json` prints."""
        pilot = {"samples": self.samples, "seconds": self.seconds, self.metric.value: self.error.as_json()}
        targets = [prediction.as_json() for prediction in self.predictions]
        return {"type": "estimate", "metric": self.metric.value, "pilot": pilot, "targets": targets}


def _with_shadow(prediction: Prediction, has_shadow: bool) -> Prediction:
    """Return the prediction with the time of a ground shadow, computed after the picture: between nothing and the same
    again."""
    seconds = prediction.seconds
    if seconds is None or not has_shadow:
        return prediction
    return replace(prediction, seconds=type(seconds)(math.sqrt(2) * seconds.value, seconds.low, 2 * seconds.high))


@with_setting_names
def estimate(
    stage: str | os.PathLike[str] | Any,
    targets: Iterable[float] = (),
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    pilot_seconds: float = PILOT_S,
    **values: Unpack[SettingsValues],
) -> CostEstimate:
    """Predict the samples and seconds that a stage, given as a Usd.Stage or as a path, needs to reach each of the target
    errors (none: round ones below the pilot's), from `pilot_seconds` of rendering.

    >>> primray.estimate("shot.usda", [0.5], resolution=(32, 18), pilot_seconds=0.1).predictions[0].seconds.value < 60
    True

    Fields of RenderSettings may be given by name: `spp` is the most samples per pixel, `target_error` a further target.
    Errors are those of `render`; KeyboardInterrupt where Ctrl-C stops the pilot.
    """
    from .. import usd
    from ..diagnostics import Diagnostics
    from ..render.prepare import prepare
    from ..report.report import Costs
    from ..sampling.prediction import run_pilot, usual_targets

    settings = with_values(settings, values)
    check_pilot(pilot_seconds)
    further = () if settings.target_error is None else (settings.target_error,)
    wanted = sorted({*targets, *further}, reverse=True)
    for target in wanted:
        RenderSettings(target_error=target)  # checks itself
    adaptive = True if settings.adaptive is None else settings.adaptive
    settings = replace(settings, target_error=min(wanted, default=SMALLEST_TARGET), adaptive=adaptive)
    opening, diagnostics = Diagnostics(), Diagnostics()
    opened = usd.open_stage(stage, opening, settings.composition)
    prepared = prepare(opened, opening, settings, Costs(), diagnostics)
    pilot = run_pilot(prepared.scene, prepared.settings, pilot_seconds)
    if pilot is None:
        raise KeyboardInterrupt
    has_shadow = prepared.ground_shadow is not None
    predictions = tuple(_with_shadow(pilot.predict(target), has_shadow) for target in wanted or usual_targets(pilot))
    row, error = pilot.row, pilot.row.error.of(pilot.metric)
    return CostEstimate(
        metric=pilot.metric,
        samples=row.samples,
        seconds=row.seconds,
        error=error,
        predictions=predictions,
        diagnostics=tuple(diagnostics),
    )
