"""Error estimates whose interval is too wide to be useful, and the few pixels and the prim that cause most of the error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Doubles, Floats
from ..sampling.error import fewest_samples
from ..settings import Metric, StopAt
from .prepared import Prepared

FACTOR = 100.0  # ratio of an interval's ends from which it is useless
FEW_SAMPLES = 16  # mean samples per pixel


def what_rules(prepared: Prepared, report: Mapping[str, Any], pixels: Floats, errors: Floats | None) -> dict[str, Any] | None:
    """Return what dominates an error whose interval spans a factor of 100 or more, and what narrows it; None for other errors.

    `pixels` are (H, W, 4), `errors` their standard errors (H, W, 3).
    """
    found = (report["error"] or {}).get(report["settings"]["error_metric"])
    if found is None or errors is None:
        return None
    low, high = found["ci95"]
    if not high >= FACTOR * low or not math.isfinite(high):
        return None
    span = f"a factor of {high / low:.3g}" if low > 0 else f"0 to {high:.3g}"
    samples = report["samples"] / pixels[..., 0].size
    larger = "a larger light helps" if prepared.settings.denoises else "a larger light or --denoise helps"
    helps = f"`primray doctor` measures which light causes it; {larger}."
    if samples < FEW_SAMPLES:
        helps = f"{samples:.3g} samples a pixel are too few for an estimate: use more (--spp)."
    rulers = _rulers(prepared, pixels, errors)
    x, y = rulers["pixel"]
    where = f"on {rulers['prim']}" if rulers["prim"] else "where no geometry is visible"
    subject = "1 pixel has" if rulers["pixels"] == 1 else f"{rulers['pixels']:,} pixels have"
    half = f"{subject} half of the error, the most of it at ({x}, {y}), {where}"
    return {**rulers, "message": f"The interval spans {span} and is not useful: {half}. {helps}"}


def why_it_continued(report: Mapping[str, Any]) -> str:
    """Return why a render took at least twice the samples at which relMSE was first estimated to be within its target, else "".

    The reason is that the estimate was too uncertain to be compared with the target.
    """
    settings, target = report["settings"], report["settings"]["target_error"]
    if target is None or settings["error_metric"] != Metric.RELMSE.value or settings["stop_at"] != StopAt.PICTURE.value:
        return ""
    rows = [row for row in report["convergence"] if 0 < row["relmse"] <= target]
    vague = [row for row in rows if row["samples"] < fewest_samples(row["ci95"][1] / row["relmse"])]
    if not vague or report["convergence"][-1]["samples"] < 2 * vague[0]["samples"]:
        return ""
    first, widest = vague[0], max(row["ci95"][1] / row["relmse"] for row in vague)
    return (
        f"From {first['samples']:.0f} samples a pixel on, the estimated error was within the target, but it might have been "
        f"{widest:.3g} times larger because of a few bright pixels, so the render continued. --clamp-indirect, --caustics off "
        "or a larger light reduce this uncertainty; --time-limit bounds the time."
    )


def weighed_errors(pixels: Floats, errors: Floats, reference: Floats | None = None) -> Doubles:
    """Return squared standard errors (H, W) over (value^2 + 0.01), the weight of relMSE.

    The values are those of `reference`, if given.
    """
    squares = np.where(np.isfinite(errors), errors, 0.0).astype(np.float64) ** 2
    reference = pixels if reference is None else reference
    values: Doubles = (squares / (reference[..., :3].astype(np.float64) ** 2 + 0.01)).mean(axis=2)
    return values


def _rulers(prepared: Prepared, pixels: Floats, errors: Floats) -> dict[str, Any]:
    """Return how many pixels have half of the error, the pixel that has most of it, and the prim there or ""."""
    from ..core import first_hits

    part = weighed_errors(pixels, errors)
    ordered = np.sort(part, axis=None)[::-1]
    count = int(np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())) + 1
    y, x = (int(at) for at in np.unravel_index(int(part.argmax()), part.shape))
    number = int(first_hits(prepared.scene, ["prim"], [], prepared.settings).planes["prim"][y, x, 0])
    assert prepared.scene.uploaded is not None
    return {"prim": prepared.scene.uploaded.shape_rows.path_of(number), "pixel": [x, y], "pixels": count}
