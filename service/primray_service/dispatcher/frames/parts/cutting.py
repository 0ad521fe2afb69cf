"""How many samples a pixel the next part of a frame is: many at first, fewer towards the end, so that no place works on alone
for long. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from primray.settings import DEFAULT_SPP, MAX_SPP, SAMPLE_BLOCK

from ....jobs import Json

LEAST = 4
LEAST_S = 1.0  # of sampling: below, much of a part is overhead; half of it at the end, where others would be idle else


@dataclass(frozen=True)
class Rules:
    """When the frame is over; `most`: samples a pixel, those that parts can take."""

    most: int
    target: float | None
    seconds: float | None


def rules_of(stop: Json) -> Rules:
    """Of a job's stop rules."""
    asked, target, limit = stop.get("max_samples"), stop.get("target_error"), stop.get("max_seconds")
    early = target is not None or limit is not None
    most = asked if asked is not None else MAX_SPP if early else DEFAULT_SPP
    return Rules(most // SAMPLE_BLOCK * SAMPLE_BLOCK, target, limit)


@dataclass(frozen=True)
class Known:
    """Seconds are one place's, None while nobody knows."""

    places: int
    sample_s: float | None = None
    load_s: float = 0.0
    left_s: float | None = None  # None: there is no time limit


def next_samples(left: int, known: Known) -> int:
    """Of the next part, where so many are wanted that nobody has taken; 0: none is to be given out now."""
    size, shortest = left / (2 * known.places), 0.0
    if known.sample_s:
        least = max(LEAST_S, known.load_s) / known.sample_s
        shortest = least / 2
        size = max(size, min(least, left / known.places), shortest)
    if known.left_s is not None:
        size = _in_time(size, known)
        shortest = min(size, shortest)
    if size <= 0:
        return 0
    samples = min(max(_blocks(size), LEAST), left)
    return left if left - samples < max(LEAST, shortest) else samples


def _in_time(size: float, known: Known) -> float:
    if known.left_s is None or known.left_s <= 0:
        return 0.0
    if known.sample_s is None:
        return min(size, LEAST)
    fits = (known.left_s - known.load_s) / known.sample_s
    return 0.0 if fits < SAMPLE_BLOCK else min(size, max(fits / 2, SAMPLE_BLOCK))


def _blocks(samples: float) -> int:
    return math.ceil(samples / SAMPLE_BLOCK - 1e-9) * SAMPLE_BLOCK
