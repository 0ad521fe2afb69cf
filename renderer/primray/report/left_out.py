"""The light that the picture leaves out because the user asked for a bias, and how the report states it.

The light removed by a clamp or by switched-off caustics is accumulated like the picture itself, so its mean is an unbiased
estimate of the bias: the picture plus what is left out converges to the picture without the bias.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import core
from ..color.color_space import ColorSpace, luminance_weights
from ..settings import BIAS, RenderSettings

BAND = 64  # rows
MOST_PIXELS = 5  # number of pixels listed, those that lose most
NAMES = {"clamp_indirect": "the clamp of indirect light", "caustics": "leaving out caustics"}


def left_out(film: core.Film, settings: RenderSettings, space: ColorSpace) -> dict[str, Any]:
    """Return the light left out, by setting; empty if no bias was asked for."""
    asked = {why: name for why, name in core.REMOVALS.items() if getattr(settings, name) != BIAS[name]}
    return {name: {"value": getattr(settings, name), **_estimate(film, why, space)} for why, name in asked.items()}


def _estimate(film: core.Film, why: str, space: ColorSpace) -> dict[str, Any]:
    """Return the mean over pixels with samples, its standard error, its share of all light, and the pixels that lose most.

    Rows are processed in bands, because a film may be most of the process's memory.
    """
    weights = np.array(luminance_weights(space))
    counts, picture, height = film.counts, film.pixels, film.resolution[1]
    colors, squares, lost, kept, pixels, touched = np.zeros(3), np.zeros(4), 0.0, 0.0, 0, 0
    most: list[tuple[float, int, int]] = []
    for first in range(0, height, BAND):
        end = min(first + BAND, height)
        means, differences = film.removed_rows(why, first, end)
        sampled = counts[:, first:end].sum(axis=0) > 0
        luminances = means @ weights
        colors += means.sum(axis=(0, 1))
        squares += (np.concatenate([differences, (differences @ weights)[..., None]], axis=2)[sampled] ** 2).sum(axis=0)
        lost += float(luminances.sum())
        kept += float((picture[first:end, :, :3].astype(np.float64) @ weights).sum())
        pixels += int(sampled.sum())
        touched += int((luminances != 0).sum())
        most = sorted(most + _most(luminances, first), key=lambda found: (-found[0], found[2], found[1]))[:MOST_PIXELS]
    count = max(pixels, 1)
    errors = [math.sqrt(value) / count if pixels and math.isfinite(value) else None for value in squares.tolist()]
    total = lost + kept
    return {
        "mean": [value / count for value in colors.tolist()],
        "stderr": errors[:3],
        "luminance": lost / count,
        "luminance_stderr": errors[3],
        "share": lost / total if total > 0 else 0.0,
        "share_stderr": None if errors[3] is None or total <= 0 else errors[3] * count / total,
        "pixels": touched,
        "most": [[x, y, value] for value, x, y in most],
    }


def _most(luminances: Any, first_row: int) -> list[tuple[float, int, int]]:
    """Return (luminance, x, y) of the pixels of a band that lose most, y from the picture's top."""
    flat, width = luminances.ravel(), luminances.shape[1]
    order = np.argsort(-flat, kind="stable")[:MOST_PIXELS]
    return [(float(flat[i]), int(i % width), first_row + int(i // width)) for i in order if flat[i] > 0]


def left_out_lines(report: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each bias in a report."""
    return [_line(name, found) for name, found in report.get("left_out", {}).items()]


def _line(name: str, found: Mapping[str, Any]) -> str:
    error, share_error = found["luminance_stderr"], found["share_stderr"]
    value = f" at {found['value']:g}" if name == "clamp_indirect" else ""
    by = "" if error is None else f" ± {error:.2g}"
    of_all = f"{100 * found['share']:.3g} %" + ("" if share_error is None else f" ± {100 * share_error:.2g}")
    sentence = f"bias: {NAMES[name]}{value} removed mean luminance {found['luminance']:.3g}{by}, {of_all} of all light"
    if found["most"]:
        x, y, most = found["most"][0]
        sentence += f"; most at pixel {x}, {y}: {most:.3g}"
    return sentence
