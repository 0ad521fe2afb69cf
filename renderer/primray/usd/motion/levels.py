"""Moving prims and levels of moving instances during traversal: transforms are composed from transform ops at their own
samples, for any time on request.

Apart from `rows_at` moving levels behave as their state at the frame. Translation replaces them (matrices.py): none reaches a
description. `ShapePlacements` gives the largest scale from a shape's own lengths to pixels over the shutter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description.placement import Instances, MatrixInstances, chunks, compose, transformed_box
from .timing import Foreseen

Rows = Callable[[float], Doubles]  # offset from the frame -> (K, 3, 4)


def _no_rows(_: float) -> Doubles:
    return np.zeros((0, 3, 4))


@dataclass(frozen=True, eq=False)
class MovingLevel(MatrixInstances):
    """Level of moving instances. `matrices` are those at the frame; `times` are offsets from the frame at which any of the
    paths may bend."""

    rows_at: Rows = _no_rows
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


def any_moves(chain: Sequence[Instances]) -> bool:
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


def concatenated_levels(chains: Sequence[Sequence[Instances]]) -> MovingLevel:
    """Return the instances of several chains, concatenated; the caller sets names and primvars."""

    def rows_at(offset: float) -> Doubles:
        return np.concatenate([product_at(chain, offset) for chain in chains])

    times = sorted({time for chain in chains for time in times_of(chain)})
    return MovingLevel(rows_at(0.0), rows_at=rows_at, times=tuple(times))


Local = Callable[[float], Doubles]  # offset from the frame -> (4, 4) parent_from_prim


class Mover:
    """Animated transform, below another one or none, with a static matrix between the two."""

    def __init__(self, above: Mover | None, between: Doubles, local: Local, times: Iterable[float]) -> None:
        self._above = above
        self._between = between
        self._local = local
        self.times: tuple[float, ...] = tuple(sorted({*times, *(above.times if above else ())}))
        self._known: dict[float, Doubles] = {}

    def at(self, offset: float) -> Doubles:
        """Return group_from_prim (4, 4) at an offset from the frame, in time codes."""
        known = self._known.get(offset)
        if known is None:
            known = self._between @ self._local(offset)
            if self._above is not None:
                known = self._above.at(offset) @ known
            self._known[offset] = known
        return known


@dataclass(frozen=True, eq=False)
class ShapePlacements:
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
