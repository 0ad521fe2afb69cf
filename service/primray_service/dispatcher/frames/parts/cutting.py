"""How many samples a pixel the next part of a frame is: many at first, fewer towards the end, so that no place works on alone
for long. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from primray.settings import DEFAULT_SPP, MAX_SPP, SAMPLE_BLOCK

from ....jobs import Json

FIRST = 8  # samples, of parts that are given out before anything is known
AHEAD = 2  # such parts a place
LEAST = 4
LEAST_S = 1.0  # of sampling: below, parts are mostly overhead
SPARE = 1.02  # times the samples at which the error should be small enough


@dataclass(frozen=True)
class Rules:
    """When the frame is over; `most`: samples a pixel, those that parts can take."""

    most: int
    target: float | None
    metric: str
    seconds: float | None


def rules_of(stop: Json) -> Rules:
    """Of a job's stop rules."""
    asked, target, limit = stop.get("max_samples"), stop.get("target_error"), stop.get("max_seconds")
    early = target is not None or limit is not None
    most = asked if asked is not None else MAX_SPP if early else DEFAULT_SPP
    return Rules(most // SAMPLE_BLOCK * SAMPLE_BLOCK, target, stop.get("metric", "relmse"), limit)


@dataclass(frozen=True)
class Known:
    """`error`: the estimate of the first `merged` samples; seconds are one place's, None while nobody knows."""

    places: int
    merged: int = 0
    error: float | None = None
    sample_s: float | None = None
    load_s: float = 0.0
    left_s: float | None = None  # None: there is no time limit


def expected_end(rules: Rules, known: Known) -> int | None:
    """Samples after which the frame should be over by its error or its samples; None: that is not known yet."""
    if rules.target is None:
        return rules.most
    if known.error is None or not known.merged:
        return None
    if known.error <= rules.target:  # by too few samples to be sure of it
        wanted = known.merged * 1.25
    else:
        power = 1.0 if rules.metric == "relmse" else 2.0  # relMSE is a square
        wanted = min(SPARE * known.merged * (known.error / rules.target) ** power, float(rules.most))
    return min(max(_blocks(wanted), known.merged + LEAST), rules.most)


def next_samples(given: int, rules: Rules, known: Known) -> int:
    """Of the part that follows the first `given` samples; 0: none is to be given out now."""
    end = expected_end(rules, known)
    left = (rules.most if end is None else end) - given
    if end is None and given - known.merged >= AHEAD * known.places * FIRST:
        return 0  # or a target that is met soon would be passed by far
    if left <= 0:
        return 0
    size = float(FIRST)
    if end is not None and (known.sample_s is not None or known.left_s is None):
        size = left / (2 * known.places)
    if known.sample_s and end is not None:
        least = max(LEAST_S, known.load_s) / known.sample_s
        size = max(size, min(least, left / known.places))
    if known.left_s is not None:
        size = _in_time(size, known)
    if size <= 0:
        return 0
    samples = min(max(_blocks(size), LEAST), left)
    return left if left - samples < LEAST else samples


def _in_time(size: float, known: Known) -> float:
    if known.left_s is None or known.left_s <= 0:
        return 0.0
    if known.sample_s is None:
        return min(size, LEAST)
    fits = (known.left_s - known.load_s) / known.sample_s
    return 0.0 if fits < SAMPLE_BLOCK else min(size, max(fits / 2, SAMPLE_BLOCK))


def _blocks(samples: float) -> int:
    return math.ceil(samples / SAMPLE_BLOCK - 1e-9) * SAMPLE_BLOCK
