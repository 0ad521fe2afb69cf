"""`primray estimate`: samples and seconds that a target error would cost, from a pilot render of a few seconds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...settings import RenderSettings
from .. import option_values
from ..flags import CONTENTS, FRAMES, LIGHTING, SIZE, SURFACES, VIEWPOINT, frames_in, in_order, setting_values

if TYPE_CHECKING:
    from ...diagnosis.estimate import CostEstimate
    from ...sampling.prediction import Prediction

VAGUE = 2.0  # factor by which the pilot's error may be underestimated, from which a warning is printed


@in_order(
    *("scene", "target_errors", "error_metric", "pilot_seconds", "adaptive", "spp", *VIEWPOINT, *SIZE, *FRAMES),
    *("max_depth", "clamp_indirect", "caustics", "filter", "filter_width", "threads", "seed", *SURFACES, "lens_flaws"),
    *("json", "rendering_color_space", *LIGHTING, *CONTENTS, "verbose"),
)
def estimate(
    scene: str,
    target_errors: Annotated[
        list[float] | None,
        typer.Option("--target-error", metavar="E", help="Target error to estimate; may be repeated.", show_default="several"),
    ] = None,
    pilot_seconds: float = 3.0,
    json: bool = False,
    verbose: bool = False,
    **given: Any,
) -> None:
    """Predict the samples and seconds that a render needs to reach an error, without rendering it."""
    from ...diagnosis.estimate import estimate as cost
    from ...diagnostic_messages import print_diagnostics
    from ..console import print_line

    targets = target_errors or []
    time_code = option_values.one_frame_of(frames_in(given, scene), "estimate")
    settings = RenderSettings(**setting_values(given), time_code=time_code)
    found = cost(scene, targets, settings, pilot_seconds=pilot_seconds)
    print_diagnostics([diagnostic.as_json() for diagnostic in found.diagnostics], verbose=verbose)
    if json:
        print_line(found.as_json())
    else:
        print("\n".join(_lines(found)))


def _lines(cost: CostEstimate) -> Iterator[str]:
    metric, known = cost.metric.value, cost.error
    yield (
        f"pilot: {cost.samples:.0f} samples a pixel in {cost.seconds:.2f} s, "
        f"{metric} {known.value:.3g} (95 %: {known.low:.3g} to {known.high:.3g})"
    )
    if not cost.predictions:
        yield "the picture has no measurable error"
        return
    if known.high >= VAGUE * known.value > 0:
        larger = known.high / known.value
        yield (
            f"the error may be {larger:.3g} times larger, because of a few bright pixels: a render continues until it is "
            "known better, which a pilot cannot predict; a longer pilot (--pilot) narrows the intervals"
        )
    yield f"{metric:>10}  {'samples':>8}  {'(95 %)':>17}  {'seconds':>8}  {'(95 %)':>17}"
    yield from map(_line, cost.predictions)


def _line(prediction: Prediction) -> str:
    samples, seconds = prediction.samples, prediction.seconds
    if samples is None or seconds is None:
        return f"{prediction.target:>10.3g}  more samples than allowed"
    return (
        f"{prediction.target:>10.3g}  {samples.value:>8.0f}  {f'{samples.low:.0f} - {samples.high:.0f}':>17}  "
        f"{seconds.value:>8.1f}  {f'{seconds.low:.1f} - {seconds.high:.1f}':>17}"
    )
