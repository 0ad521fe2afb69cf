"""Attribute values at the time of the render, checked: a value of an unexpected kind is a diagnostic, never an exception.

At the default time an attribute without a default value is read at its earliest value, if it has any. USD's row-vector matrices
become column-vector numpy arrays here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Gf, Usd, UsdGeom

from ...arrays import Doubles, Floats
from ...diagnostics import Diagnostics
from .reads import authored_attributes, is_invisible, property_names, targets, type_name, value_at
from .time_varying import earliest_if_unset, has_clips, has_samples, has_spline, number_of
from .traversal import populated

MAX_COLUMNS = 4  # of a primvar


@dataclass(frozen=True)
class When:
    """The time to read at; `careful` when it is the default time and the stage has time samples or value clips at all.

    No layer lists its splines: at the default time each scalar is checked for one. `offset`, in time codes, counts from the
    earliest value where that stands in for the frame.
    """

    time: Usd.TimeCode
    careful: bool
    at_knots: set[str] = field(default_factory=set, compare=False)  # paths of prims that were read at a spline's first knot
    offset: float = 0.0
    is_default: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "is_default", self.time.IsDefault())

    @property
    def number(self) -> float:
        """The frame as a number; only valid where there is one."""
        return float(self.time.GetValue())

    def after(self, offset: float) -> When:
        """Return the time `offset` time codes later, counted from the earliest value where that stands in for the frame."""
        if offset == 0.0:
            return self
        if self.is_default:
            return replace(self, offset=self.offset + offset)
        return replace(self, time=Usd.TimeCode(self.number + offset))


def when_of(stage: Usd.Stage, time_code: float | None, clips: bool | None = None) -> When:
    """Return the time to read at. `clips`: whether what is read has value clips, where that is known; else all prims are
    checked."""
    if time_code is not None:
        return When(Usd.TimeCode(time_code), careful=False)
    return When(Usd.TimeCode.Default(), careful=has_samples_or_clips(stage, clips))


def when_of_few(time_code: float | None) -> When:
    """Return the time to read at for so few prims that each attribute may be checked for samples, instead of all layers."""
    return When(Usd.TimeCode.Default(), careful=True) if time_code is None else When(Usd.TimeCode(time_code), careful=False)


def has_samples_or_clips(stage: Usd.Stage, clips: bool | None = None) -> bool:
    """Return whether any layer of the stage has time samples, or any prim value clips; `clips` as for `when_of`."""
    return has_samples(stage.GetUsedLayers()) or (any(map(has_clips, populated(stage))) if clips is None else clips)


def time_of(attribute: Usd.Attribute, when: When) -> Usd.TimeCode:
    """Return the time at which to read this attribute."""
    if not (when.careful or (when.is_default and has_spline(attribute))):
        return when.time
    earliest = earliest_if_unset(attribute)
    if earliest is None:
        return when.time
    if not earliest.IsEarliestTime():
        when.at_knots.add(str(attribute.GetPrimPath()))
    if when.offset:
        first = number_of(earliest, attribute)
        return earliest if first is None else Usd.TimeCode(first + when.offset)
    return earliest


def value(attribute: Usd.Attribute, when: When) -> Any:
    """Return the attribute's value; None when it has none."""
    if when.careful:
        return value_at(attribute, time_of(attribute, when))
    found = value_at(attribute, when.time)
    if when.is_default and (found is None or isinstance(found, float)) and has_spline(attribute):  # only scalars have splines
        return value_at(attribute, time_of(attribute, when))
    return found


def read(prim: Usd.Prim, name: str, when: When) -> Any:
    attribute = prim.GetAttribute(name)
    return value(attribute, when) if attribute else None


def is_hidden(prim: Usd.Prim, when: When) -> bool:
    """Return whether the prim is invisible, by its own opinion or one above it (UsdGeomImageable::ComputeVisibility)."""
    if not when.careful:
        return is_invisible(prim, when.time)
    while prim:
        if prim.IsA(UsdGeom.Imageable) and read(prim, "visibility", when) == UsdGeom.Tokens.invisible:
            return True
        prim = prim.GetParent()
    return False


class StandIns:
    """Prims for functions of USD that read several attributes at one time: without a frame there is no such time.

    A stand-in is on a separate stage and has the values that `value` reads as its defaults. Where all values are defaults it is
    the prim itself.
    """

    def __init__(self, when: When) -> None:
        self.when = when
        self.time = when.time  # the time to read stand-ins at
        self._stage: Usd.Stage | None = None
        self._known: dict[Usd.Prim, Usd.Prim] = {}

    def of(self, prim: Usd.Prim, *relationships: str) -> Usd.Prim:
        """Return the prim to pass to USD, with the targets of these relationships."""
        if not self.when.is_default:
            return prim
        if prim not in self._known:
            led_to = [prim.GetStage().GetPrimAtPath(path) for name in relationships for path in targets(prim, name)]
            concerned = [prim, *filter(None, led_to)]
            varies = any(earliest_if_unset(a) is not None for each in concerned for a in authored_attributes(each))
            self._known[prim] = self._made(concerned, relationships) if varies else prim
        return self._known[prim]

    def _made(self, concerned: list[Usd.Prim], relationships: tuple[str, ...]) -> Usd.Prim:
        self._stage = self._stage or Usd.Stage.CreateInMemory()
        for prim in concerned:
            made = self._stage.DefinePrim(prim.GetPath(), type_name(prim))
            for attribute in authored_attributes(prim):
                found = value(attribute, self.when)
                if found is not None:
                    made.CreateAttribute(attribute.GetName(), attribute.GetTypeName()).Set(found)
        for name in relationships:
            self._stage.GetPrimAtPath(concerned[0].GetPath()).CreateRelationship(name).SetTargets(targets(concerned[0], name))
        return self._stage.GetPrimAtPath(concerned[0].GetPath())


def array(raw: Any, columns: int, kind: str) -> npt.NDArray[Any] | None:
    """Return a numpy array (N, columns), or (N,) for one column, of dtype kind `f` or `i`; None when `raw` is no such thing."""
    try:
        values = np.asarray(raw)
    except (TypeError, ValueError):
        return None
    if values.size == 0 and values.dtype.kind in "fiuO":
        values = np.zeros((0, columns) if columns > 1 else (0,), np.float32 if kind == "f" else np.int32)
    ok = values.ndim == (2 if columns > 1 else 1) and values.dtype.kind in ("f" if kind == "f" else "iu")
    return values if ok and (columns == 1 or values.shape[1] == columns) else None


def is_single(raw: Any) -> bool:
    """Return whether a value is one number or vector, not an array of them."""
    return isinstance(raw, int | float | str) or type(raw).__module__ == "pxr.Gf"


def as_columns(raw: Any, element_size: int) -> Floats | None:
    """Return (N, 1 to 4) float32 from an array of numbers or vectors; None when it is none, or does not have whole elements."""
    try:
        values = np.asarray(raw)
    except (TypeError, ValueError):
        return None
    if values.size == 0:
        return np.zeros((0, 1), np.float32)
    if values.dtype.kind not in "fiub" or values.ndim > 2:
        return None
    columns = (values.shape[1] if values.ndim == 2 else 1) * max(element_size, 1)
    if columns > MAX_COLUMNS or values.size % columns:
        return None
    return values.astype(np.float32, copy=False).reshape(-1, columns)


def number(prim: Usd.Prim, name: str, when: When, default: float, diagnostics: Diagnostics, then: str = "") -> float:
    """Return a finite number; `default` when there is none, with a diagnostic when the value is not a finite number.

    `then`: what the diagnostic says of the default, if that is no value that is used.
    """
    raw = read(prim, name, when)
    if raw is None:
        return default
    if isinstance(raw, int | float) and not isinstance(raw, bool) and math.isfinite(raw):
        return float(raw)
    message = f"{name} = {raw!r} is not a finite number; {then or f'{default:g} is used'}."
    diagnostics.add("wrong-type", str(prim.GetPath()), message, name)
    return default


def vector(prim: Usd.Prim, name: str, when: When, default: tuple[float, ...], diagnostics: Diagnostics) -> tuple[float, ...]:
    """Return as many finite numbers as `default` has, or `default`, with a diagnostic when the value is not of this kind."""
    raw = read(prim, name, when)
    if raw is None:
        return default
    try:
        values = tuple(float(x) for x in raw)
    except (TypeError, ValueError):
        values = ()
    if len(values) == len(default) and all(map(math.isfinite, values)):
        return values
    diagnostics.add(
        "wrong-type", str(prim.GetPath()), f"{name} = {raw!r} is not {len(default)} finite numbers; {default} is used.", name
    )
    return default


def token(prim: Usd.Prim, name: str, when: When, default: str) -> str:
    raw = read(prim, name, when)
    return raw if isinstance(raw, str) and raw else default


def flag(prim: Usd.Prim, name: str, when: When, default: bool, diagnostics: Diagnostics | None = None) -> bool:
    """Return whether an attribute is set; `default` when it is not a bool or an integer, which `diagnostics` get."""
    raw = read(prim, name, when)
    if isinstance(raw, bool | int):
        return bool(raw)
    if raw is not None and diagnostics is not None:
        message = f"{name} = {raw!r} is neither true nor false; {str(default).lower()} is used."
        diagnostics.add("wrong-type", str(prim.GetPath()), message, name)
    return default


def report_without_value(prim: Usd.Prim, names: Iterable[str], when: When, diagnostics: Diagnostics) -> None:
    """Report properties of these names that are authored and have no value: relationships, and attributes whose value comes by
    a connection."""
    for name in sorted(set(property_names(prim)).intersection(names)):
        attribute = prim.GetAttribute(name)
        if not attribute:
            diagnostics.add("wrong-type", str(prim.GetPath()), f"{name} is a relationship; an attribute is expected.", name)
        elif attribute.HasAuthoredConnections() and value(attribute, when) is None:
            message = f"{name} is connected, which has no effect; a value is expected."
            diagnostics.add("wrong-type", str(prim.GetPath()), message, name)


def matrix(gf: Gf.Matrix4d) -> Doubles:
    """Return the matrix as (4, 4) float64, column-vector."""
    return np.array(gf, np.float64).T.copy()


def square(upper: Doubles) -> Doubles:
    """Return the (4, 4) matrix with these upper three rows."""
    whole = np.empty((4, 4))
    whole[:3], whole[3] = upper, (0.0, 0.0, 0.0, 1.0)
    return whole
