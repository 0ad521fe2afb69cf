"""The two independent halves of a film: each replicate's mean, as radiance times exposure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import core
from ..arrays import Doubles


@dataclass(frozen=True)
class Halves:
    """Means (H, W, 3) of both replicates.

    `share` (H, W, 1) is the part of a pixel's samples in `a`: 1/2 where both have as many.
    """

    a: Doubles
    b: Doubles
    share: Doubles
    are_whole: bool  # every pixel has samples in both halves

    @property
    def mean(self) -> Doubles:
        """The picture as the film has it: the sample-weighted mean of both halves."""
        made: Doubles = self.share * self.a + (1 - self.share) * self.b
        return made


def halves_of(film: core.Film, exposure_scale: float) -> Halves:
    sums, counts = film.replicates, film.counts.astype(np.float64)[..., None]
    means = sums[..., :3] / np.maximum(counts, 1) * exposure_scale
    total = np.maximum(counts.sum(axis=0), 1)
    return Halves(means[0], means[1], counts[0] / total, bool((counts > 0).all()))
