"""Levels of moving instances during traversal: transforms are computed for any time on request.

Apart from `rows_at` they behave as their state at the frame. Translation replaces them (settle.py): none reaches a description.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description.placement import Instances, MatrixInstances, chunks, compose
from .mover import Mover

Rows = Callable[[float], Doubles]  # offset from the frame -> (K, 3, 4)


def _nowhere(_: float) -> Doubles:
    return np.zeros((0, 3, 4))


@dataclass(frozen=True, eq=False)
class MovingLevel(MatrixInstances):
    """Level of moving instances. `matrices` are those at the frame; `times` are offsets from the frame at which any of the
    paths may bend."""

    rows_at: Rows = _nowhere
    times: tuple[float, ...] = ()

    def take(self, chosen: npt.NDArray[Any]) -> MovingLevel:
        """Return the instances chosen by a mask or an array of indices."""
        kept = super().take(chosen)
        rows_at = self.rows_at
        return MovingLevel(kept.matrices, kept.primvars, kept.names, lambda offset: rows_at(offset)[chosen], self.times)

    def placed(self, outer: Doubles, name: str = "") -> MovingLevel:
        """Return the instances transformed by a further matrix (3, 4), below an instance called `name`."""
        moved = super().placed(outer, name)
        rows_at = self.rows_at
        return MovingLevel(
            moved.matrices, moved.primvars, moved.names, lambda offset: compose(outer[None], rows_at(offset)), self.times
        )


def level_of(movers: Sequence[Mover], inner: Doubles) -> MovingLevel:
    """Return one instance for each mover, each with the static matrix (4, 4) of what is below it from `inner` (K, 4, 4)."""

    def rows_at(offset: float) -> Doubles:
        return np.stack([mover.at(offset) @ below for mover, below in zip(movers, inner, strict=True)])[:, :3]

    times = sorted({time for mover in movers for time in mover.times})
    return MovingLevel(rows_at(0.0), rows_at=rows_at, times=tuple(times))


def moving_level(rows_at: Rows, times: Sequence[float], like: Instances) -> MovingLevel:
    """Return moving instances with the primvars and names of `like`."""
    return MovingLevel(rows_at(0.0), like.primvars, like.names, rows_at, tuple(times))


def do_move(chain: Sequence[Instances]) -> bool:
    return any(isinstance(level, MovingLevel) for level in chain)


def times_of(chain: Sequence[Instances]) -> tuple[float, ...]:
    """Return the offsets from the frame at which the path of any instance may bend."""
    return tuple(sorted({time for level in chain if isinstance(level, MovingLevel) for time in level.times}))


def level_at(level: Instances, offset: float) -> Instances:
    """Return the static instances at an offset from the frame."""
    if not isinstance(level, MovingLevel):
        return level
    return MatrixInstances(level.rows_at(offset), level.primvars, level.names)


def chain_at(chain: Sequence[Instances], offset: float) -> tuple[Instances, ...]:
    return tuple(level_at(level, offset) for level in chain)


def product_at(chain: Sequence[Instances], offset: float) -> Doubles:
    """Return the products (K, 3, 4) of all levels, the last level varying fastest."""
    return np.concatenate(list(chunks(chain_at(chain, offset))))


def joined(chains: Sequence[Sequence[Instances]]) -> MovingLevel:
    """Return the instances of several chains, concatenated; the caller sets names and primvars."""

    def rows_at(offset: float) -> Doubles:
        return np.concatenate([product_at(chain, offset) for chain in chains])

    times = sorted({time for chain in chains for time in times_of(chain)})
    return MovingLevel(rows_at(0.0), rows_at=rows_at, times=tuple(times))
