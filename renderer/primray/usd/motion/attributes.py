"""Animated attributes: which of them change around the shutter, at which times their paths bend, and the value of arrays and
local transforms at any time.

Arrays are interpolated in double precision: rounded values would make paths bend everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Usd, UsdGeom

from ...arrays import Doubles
from ..stage.reads import local_transform_at, value_at
from ..stage.time_varying import bracket, is_linear, might_vary, number_of, scalar_operations, times_between, varies
from ..stage.values import When, array, matrix, time_of
from .levels import Local
from .matrices import slerp
from .timing import Timing


def animated_operations(prim: Usd.Prim, names: frozenset[str], when: When, timing: Timing) -> list[Usd.Attribute]:
    """Return the transform ops that change around the shutter."""
    if timing.is_frame:
        return []
    asked = [name for name in names if name.startswith("xformOp:")] if timing.is_timed else scalar_operations(names)
    attributes = map(prim.GetAttribute, asked)
    return [attribute for attribute in attributes if is_animated(attribute, when, timing)]


def is_animated(attribute: Usd.Attribute, when: When, timing: Timing) -> bool:
    """Return whether the attribute's value changes around the shutter."""
    if not attribute or not might_vary(attribute):
        return False
    frame = number_of(time_of(attribute, when), attribute)
    first, last = timing.looked_at
    return frame is not None and varies(attribute, frame + first, frame + last)


def bend_times(attributes: Iterable[Usd.Attribute], when: When, timing: Timing) -> list[float]:
    """Return the offsets from the frame, around the shutter, at which the path of any of the attributes may bend."""
    first, last = timing.looked_at
    found: set[float] = set()
    for attribute in attributes:
        frame = number_of(time_of(attribute, when), attribute)
        if frame is not None:
            found.update(time - frame for time in times_between(attribute, frame + first, frame + last))
    return sorted(found)


def local_transform(prim: Usd.Prim, when: When) -> Local:
    """Return the prim's local transform as a function of the offset from the frame."""

    def local(offset: float) -> Doubles:
        then = when.after(offset)
        return matrix(local_transform_at(prim, lambda attribute: time_of(attribute, then))[0])

    return local


def blur_scale_of(prim: Usd.Prim) -> float:
    """Return motion:blurScale (UsdGeomMotionAPI) of the prim or its nearest ancestor that has it."""
    api = UsdGeom.MotionAPI(prim)
    return max(float(api.ComputeMotionBlurScale()), 0.0) if api else 1.0


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
        return _slerp_rows(a, b, u) if self._columns == 4 else a + u * (b - a)

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


def _slerp_rows(a: Rows, b: Rows, u: float) -> Rows:
    """Return interpolated quaternions; those of length 0 count as no rotation."""
    return slerp(_unit_quaternions(a), _unit_quaternions(b), u)


def _unit_quaternions(q: Rows) -> Rows:
    length = np.linalg.norm(q, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(length > 0, q / np.where(length > 0, length, 1.0), np.array([0.0, 0.0, 0.0, 1.0]))
