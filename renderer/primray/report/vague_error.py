"""Errors that are hardly known: which pixels, prims, lights and paths rule them, and what they make an error asked for take.

An error is vague if its interval is too wide to be useful: few bright samples rule it, and more of their kind were not found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import core
from ..arrays import Doubles, Floats
from ..sampling.error import ONE_PERCENT, Estimate, fewest_samples
from ..settings import Metric, StopAt
from .rare_paths import RarePaths, find_rare_paths

if TYPE_CHECKING:
    from ..sampling.sampling import Sampling
    from .prepared import Prepared


VAGUE_FACTOR = 30.0  # the square of the lower end's factor (ratio of an even interval's ends) from which it is useless
FEW_SAMPLES = 16  # mean samples per pixel
SEEN_AS_THEY_ARE = ("CL", "CO")
LITTLE = 0.05  # of a render's samples


def what_rules(
    prepared: Prepared, sampling: Sampling, report: Mapping[str, Any], pixels: Floats, errors: Floats | None
) -> dict[str, Any] | None:
    """Return what rules an error whose interval is useless, and what narrows it; None for other errors.

    `pixels` are (H, W, 4), `errors` their standard errors (H, W, 3).
    """
    found = (report["error"] or {}).get(report["settings"]["error_metric"])
    if found is None or errors is None:
        return None
    low, high = found["ci95"]
    if not Estimate(found["estimate"], low, high).doubt ** 2 >= VAGUE_FACTOR or not math.isfinite(high):
        return None
    part = sampling.film.error_parts(core.threads(prepared.settings))
    rulers = _rulers(prepared, part)
    rare = find_rare_paths(prepared.scene, sampling, part)
    x, y = rulers["pixel"]
    where = f"on {rulers['prim']}" if rulers["prim"] else "where no geometry is visible"
    subject = "1 pixel has" if rulers["pixels"] == 1 else f"{rulers['pixels']:,} pixels have"
    span = f"a factor of {high / low:.3g}" if low > 0 else f"0 to {high:.3g}"
    said = [f"The interval spans {span} and is not useful: {subject} half of the error, the most of it at ({x}, {y}), {where}."]
    if rare is not None:
        rulers |= {"paths": [path.as_json() for path in rare.paths], "error_without": rare.without}
        said += [f"{path.share:.0%} of it comes by {path.expression}: {path.seen}." for path in rare.paths]
        if report["error"].get(Metric.RELMSE.value) is not None:
            rulers["to_target"] = to_target(report, rare)
            said.append(_in_words(rulers["to_target"]))
    said.append(_what_helps(prepared, report["samples"] / pixels[..., 0].size, rare))
    return {**rulers, "message": " ".join(said)}


def to_target(report: Mapping[str, Any], rare: RarePaths) -> dict[str, Any]:
    """Return the samples that relMSE's target takes (that of 1 % if none is asked for), in those of this render, with its
    interval, and without the rare paths. The error falls with the reciprocal of samples."""
    settings, error = report["settings"], report["error"][Metric.RELMSE.value]
    asked = settings["target_error"] if settings["error_metric"] == Metric.RELMSE.value else None
    target = ONE_PERCENT if asked is None else asked
    times = {"estimate": error["estimate"] / target, "ci95": [end / target for end in error["ci95"]]}
    return {"relmse": target, "times": times, "times_without": error["estimate"] * rare.without / target}


def _in_words(found: Mapping[str, Any]) -> str:
    low, high = found["times"]["ci95"]
    without = found["times_without"]
    return (
        f"A relMSE of {found['relmse']:g} takes {low:.2g} to {high:.2g} times this render's samples, and "
        f"{f'about {without:.2g} times' if without >= LITTLE else 'hardly any'} without these paths."
    )


def _what_helps(prepared: Prepared, samples: float, rare: RarePaths | None) -> str:
    if samples < FEW_SAMPLES:
        return f"{samples:.3g} samples a pixel are too few for an estimate: use more (--spp)."
    larger = "a larger light helps" if prepared.settings.denoises else "a larger light or --denoise helps"
    if rare is None:
        return f"`primray doctor` measures which light causes it; {larger}."
    ruler = rare.paths[0].expression
    if ruler in SEEN_AS_THEY_ARE:
        return "Its outline is between pixels: more samples (--spp) smooth it."
    return f"--aov '{ruler}' shows where they arrive; {larger}."


def why_it_continued(report: Mapping[str, Any]) -> str:
    """Return why a render took at least twice the samples at which relMSE was first estimated to be within its target, else "".

    The reason is that the estimate was too uncertain to be compared with the target.
    """
    settings, target = report["settings"], report["settings"]["target_error"]
    if target is None or settings["error_metric"] != Metric.RELMSE.value or settings["stop_at"] != StopAt.PICTURE.value:
        return ""
    rows = [row for row in report["convergence"] if 0 < row["relmse"] <= target]
    vague = [row for row in rows if row["samples"] < fewest_samples(_known(row).doubt)]
    if not vague or report["convergence"][-1]["samples"] < 2 * vague[0]["samples"]:
        return ""
    first, widest = vague[0], max(row["ci95"][1] / row["relmse"] for row in vague)
    return (
        f"From {first['samples']:.0f} samples a pixel on, the estimated error was within the target, but it might have been "
        f"{widest:.3g} times larger because of a few bright pixels, so the render continued. --clamp-indirect, --caustics off "
        "or a larger light reduce this uncertainty; --time-limit bounds the time."
    )


def _known(row: Mapping[str, Any]) -> Estimate:
    """Return relMSE of a row of the report's curve."""
    return Estimate(row["relmse"], *row["ci95"])


def _rulers(prepared: Prepared, part: Doubles) -> dict[str, Any]:
    """Return how many pixels have half of the error, the pixel that has most of it, and the prim there or "".

    `part` are the pixels' parts of the error (H, W).
    """
    from ..core import first_hits

    ordered = np.sort(part, axis=None)[::-1]
    count = int(np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())) + 1
    y, x = (int(at) for at in np.unravel_index(int(part.argmax()), part.shape))
    number = int(first_hits(prepared.scene, ["prim"], [], prepared.settings).planes["prim"][y, x, 0])
    assert prepared.scene.uploaded is not None
    return {"prim": prepared.scene.uploaded.shape_rows.path_of(number), "pixel": [x, y], "pixels": count}
