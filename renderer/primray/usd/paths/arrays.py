"""Array attributes at any time, interpolated in double precision: rounded values would make paths bend everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Usd

from ..moving.between import slerp
from ..stage.reads import value_at
from ..stage.time_varying import bracket, is_linear, number_of
from ..stage.values import When, array, time_of

Rows = npt.NDArray[Any]


class ArrayPath:
    """Attribute of vectors (one column for numbers) near the frame; quaternions turn the shorter way."""

    def __init__(self, attribute: Usd.Attribute, columns: int, when: When) -> None:
        self.attribute = attribute
        self._columns = columns
        self.frame = number_of(time_of(attribute, when), attribute)  # None if it has no time samples
        self._when = when
        self._known: dict[float, Rows | None] = {}

    def at(self, offset: float) -> Rows | None:
        """Return the value at an offset in time codes from the frame; None if it is no array. If neighbouring samples differ in
        length, the earlier one is held."""
        if self.frame is None:
            return self._read(None)
        time = self.frame + offset
        around = bracket(self.attribute, time)
        if around is None or around[0] == around[1] or not is_linear(self.attribute, time):
            return self._read(time)
        first, last = map(self._read, around)
        if first is None or last is None or len(first) != len(last):
            return first
        u = (time - around[0]) / (around[1] - around[0])
        a, b = first.astype(np.float64), last.astype(np.float64)
        return _turned(a, b, u) if self._columns == 4 else a + u * (b - a)

    def sample(self, time: float) -> Rows | None:
        """Return the sample at a stage time that has one."""
        return self._read(time)

    def bracket(self) -> tuple[float, float] | None:
        """Return the times of the samples around the frame; None if there are none."""
        return None if self.frame is None else bracket(self.attribute, self.frame)

    def _read(self, time: float | None) -> Rows | None:
        key = -np.inf if time is None else time
        if key not in self._known:
            when = time_of(self.attribute, self._when) if time is None else Usd.TimeCode(time)
            self._known[key] = array(value_at(self.attribute, when), self._columns, "f")
        return self._known[key]


def _turned(a: Rows, b: Rows, u: float) -> Rows:
    """Return interpolated quaternions; those of length 0 count as no rotation."""
    return slerp(_unit(a), _unit(b), u)


def _unit(q: Rows) -> Rows:
    length = np.linalg.norm(q, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(length > 0, q / np.where(length > 0, length, 1.0), np.array([0.0, 0.0, 0.0, 1.0]))
