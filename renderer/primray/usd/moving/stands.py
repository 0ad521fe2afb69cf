"""Placement of one shape in the world over the shutter, and with it the largest scale from the shape's own lengths to
pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ...description.placement import Instances, chunks, transformed_box
from .foreseen import Foreseen
from .levels import chain_at


@dataclass(frozen=True, eq=False)
class Stands:
    chains: Sequence[Sequence[Instances]]
    group_from_shape: Doubles  # (4, 4)
    blur_scale: float = 1.0
    is_all: bool = True  # no other prototype contains the shape

    def per_length(self, low: Doubles, high: Doubles, seen: Foreseen) -> float:
        """Return the largest number of pixels per unit of the shape's own length, for what lies in a box of its own space."""
        timing, most = seen.timing, 0.0
        for offset in (timing.offset(fraction) for fraction in (0.0, 0.5, 1.0)):
            for chain in self.chains:
                for rows in chunks(chain_at(chain, self.blur_scale * offset)):
                    most = max(most, self._largest(rows, low, high, seen))
        return most

    def _largest(self, rows: Doubles, low: Doubles, high: Doubles, seen: Foreseen) -> float:
        """Return the largest number of pixels per unit of length over instances (K, 3, 4) world_from_group."""
        world = rows @ self.group_from_shape
        world = world[np.isfinite(world).all(axis=(1, 2))]
        if not len(world):
            return 0.0
        stretches = np.linalg.norm(world[:, :, :3], ord=2, axis=(1, 2))
        return float((stretches * seen.per_length(*transformed_box(world, (low, high)), self.is_all)).max())
