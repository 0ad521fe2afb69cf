"""Random draws by seed, frame and pixel that do not change between versions of NumPy.

Bits come from Philox (Salmon et al. 2011, "Parallel Random Numbers: As Easy as 1, 2, 3"), whose output NumPy guarantees;
distributions are made of them here, since those of NumPy's Generator may change. The counter holds the frame, what is drawn and
the round of a rejection, so no draw depends on how many came before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles

FEW = 30.0  # means below it are drawn by inversion, others by transformed rejection
SHOT, READ = 1, 2  # what is drawn
_FACTORIALS = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, 64)))])  # log k!


@dataclass(frozen=True)
class Draws:
    """The draws of one frame."""

    seed: int
    frame: int = 0

    def uniform(self, what: int, round: int, count: int) -> Doubles:
        """Return `count` numbers in (0, 1), multiples of 2^-53 plus 2^-54."""
        bits = np.random.Philox(key=[self.seed, 0x7072696D726179], counter=[0, what, round, self.frame]).random_raw(count)
        return (np.asarray(bits, np.uint64) >> np.uint64(11)).astype(np.float64) * 2.0**-53 + 2.0**-54

    def normal(self, count: int) -> Doubles:
        """Return standard normal deviates (Box and Muller 1958)."""
        radius = np.sqrt(-2 * np.log(self.uniform(READ, 0, count)))
        return np.asarray(radius * np.cos(2 * math.pi * self.uniform(READ, 1, count)))

    def poisson(self, mean: Doubles) -> Doubles:
        """Return Poisson deviates with these means (any shape), exact up to rounding of doubles."""
        flat = np.asarray(mean, np.float64).ravel()
        found = np.zeros(flat.size)
        few = flat < FEW
        found[few] = _by_inversion(flat[few], self.uniform(SHOT, 0, flat.size)[few])
        self._reject(flat, ~few, found)
        return found.reshape(np.shape(mean))

    def _reject(self, mean: Doubles, left: npt.NDArray[np.bool_], found: Doubles) -> None:
        """Draw those `left`, by Hörmann's PTRS (1993, "The transformed rejection method for generating Poisson random
        variables")."""
        round = 1
        places = np.flatnonzero(left)
        while places.size:
            u = self.uniform(SHOT, round, mean.size)[places] - 0.5
            v = self.uniform(SHOT, round + 1, mean.size)[places]
            m = mean[places]
            b = 0.931 + 2.53 * np.sqrt(m)
            a = -0.059 + 0.02483 * b
            inverse_alpha = 1.1239 + 1.1328 / (b - 3.4)
            us = 0.5 - np.abs(u)
            k = np.floor((2 * a / us + b) * u + m + 0.43)
            quick = (us >= 0.07) & (v <= 0.9277 - 3.6224 / (b - 2))
            possible = (k >= 0) & ((us >= 0.013) | (v <= us))
            whole = np.maximum(k, 0)
            below = np.log(v * inverse_alpha / (a / (us * us) + b)) <= whole * np.log(m) - m - _log_factorial(whole)
            taken = quick | (possible & below)
            found[places[taken]] = k[taken]
            places, round = places[~taken], round + 2


def _by_inversion(mean: Doubles, u: Doubles) -> Doubles:
    """Return the least k whose cumulative probability reaches `u`."""
    found = np.zeros(mean.size)
    term = np.exp(-mean)
    total = term.copy()
    left = np.flatnonzero(u > total)
    k = 0
    while left.size and k < 400:
        k += 1
        term[left] *= mean[left] / k
        total[left] += term[left]
        found[left] = k
        left = left[(u[left] > total[left]) & (term[left] > 0)]
    return found


def _log_factorial(k: Doubles) -> Doubles:
    """Return log k!, by Stirling's series beyond a table; exact to 1e-13 of it."""
    small = k < len(_FACTORIALS)
    n = np.maximum(k, 1.0)
    series = n * np.log(n) - n + 0.5 * np.log(2 * math.pi * n) + 1 / (12 * n) - 1 / (360 * n**3) + 1 / (1260 * n**5)
    return np.where(small, _FACTORIALS[np.where(small, k, 0).astype(np.int64)], series)
