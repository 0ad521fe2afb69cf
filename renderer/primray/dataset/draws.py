"""Random numbers of a data set: functions of the seed, the sample's index and the name of what varies.

Each name has a sequence of its own, the SHA-256 (FIPS 180-4) of key and counter, so that what is added to a data set changes
nothing of what was there, and neither the order of samples nor the number of processes counts. Numbers are made from bits
here, because NumPy may change how its generators make them.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from ..arrays import Doubles

T = TypeVar("T")
_WORDS = 4  # of 64 bits in a digest
_FRACTION = 2.0**-53


class Draws:
    """The random numbers of one name in one sample.

    >>> from primray.dataset import Draws
    >>> Draws(7, 0, "lamp").uniform() == Draws(7, 0, "lamp").uniform() != Draws(7, 1, "lamp").uniform()
    True
    """

    def __init__(self, seed: int, index: int, name: str) -> None:
        self.seed, self.index, self.name = seed, index, name
        self._key = json.dumps(["primray dataset 1", seed, index, name]).encode()
        self._block = 0
        self._words: list[int] = []

    def of(self, name: str) -> Draws:
        """Return the sequence of a part of what varies."""
        return Draws(self.seed, self.index, f"{self.name}\n{name}")

    def bits(self) -> int:
        """Return the next 64 bits."""
        if not self._words:
            digest = hashlib.sha256(self._key + self._block.to_bytes(8, "little")).digest()
            self._words = [int.from_bytes(digest[8 * k : 8 * k + 8], "little") for k in reversed(range(_WORDS))]
            self._block += 1
        return self._words.pop()

    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """Return a number from `low` to `high`, made of 53 bits."""
        u = (self.bits() >> 11) * _FRACTION
        return low + (high - low) * u

    def below(self, count: int) -> int:
        """Return a whole number from 0 to `count` - 1, each as likely as the others."""
        most = 2**64 - 2**64 % count
        while (bits := self.bits()) >= most:
            pass
        return bits % count

    def normal(self) -> float:
        """Return a number of the standard normal distribution (Box and Muller 1958)."""
        radius = math.sqrt(-2.0 * math.log(1.0 - self.uniform()))
        return radius * math.cos(2.0 * math.pi * self.uniform())

    def shuffled(self, items: Sequence[T]) -> list[T]:
        """Return the items in random order (Fisher and Yates)."""
        found = list(items)
        for k in range(len(found) - 1, 0, -1):
            other = self.below(k + 1)
            found[k], found[other] = found[other], found[k]
        return found

    def rotation(self) -> Doubles:
        """Return a rotation matrix (3, 3) that is uniform over all rotations (Shoemake 1992, "Uniform random rotations")."""
        u, v, w = self.uniform(), 2 * math.pi * self.uniform(), 2 * math.pi * self.uniform()
        a, b = math.sqrt(1 - u), math.sqrt(u)
        x, y, z, real = a * math.sin(v), a * math.cos(v), b * math.sin(w), b * math.cos(w)
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * real), 2 * (x * z + y * real)],
                [2 * (x * y + z * real), 1 - 2 * (x * x + z * z), 2 * (y * z - x * real)],
                [2 * (x * z - y * real), 2 * (y * z + x * real), 1 - 2 * (x * x + y * y)],
            ]
        )
