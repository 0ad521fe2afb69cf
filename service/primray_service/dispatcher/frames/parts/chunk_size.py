"""Size of the next part of a frame in samples per pixel: large at first, smaller towards the end, so that no slot is left
rendering alone for long. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from primray.settings import DEFAULT_SPP, MAX_SPP, SAMPLE_BLOCK

from ....jobs import Json

LEAST = 4
# of sampling: below, overhead is too large a share of a part; at the end half of it, where other slots would be idle
LEAST_S = 1.0


@dataclass(frozen=True)
class Rules:
    """When the frame ends; `most`: samples per pixel that parts can take."""

    most: int
    target: float | None
    seconds: float | None


def rules_of(stop: Json) -> Rules:
    """Return the rules for a job's stop rules."""
    asked, target, limit = stop.get("max_samples"), stop.get("target_error"), stop.get("max_seconds")
    early = target is not None or limit is not None
    most = asked if asked is not None else MAX_SPP if early else DEFAULT_SPP
    return Rules(most // SAMPLE_BLOCK * SAMPLE_BLOCK, target, limit)


@dataclass(frozen=True)
class Known:
    """Known costs. Seconds are those of one slot, None while unknown."""

    places: int
    sample_s: float | None = None
    load_s: float = 0.0
    left_s: float | None = None  # None: no time limit


def next_samples(left: int, known: Known) -> int:
    """Return the samples in the next part if `left` samples remain that nobody renders; 0 if no part is to be handed out
    now."""
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
