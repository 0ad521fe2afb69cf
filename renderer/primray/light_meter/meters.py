"""Light meters and grids of them: where they are, which way they look, and what they measure."""

from __future__ import annotations

import json
import math
import operator
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..errors import SettingsError, did_you_mean

CODE = "light-meter"
BORDER = 0.5  # metres along the walls that EN 12464-1 leaves out
WIDEST = 10.0  # metres between points, at most
MOST_POINTS = 100_000
FARTHEST = 1e12  # of a position from the world's origin, in scene units: what is there is not drawn
Vector = tuple[float, float, float]


class MeterKind(Enum):
    """What a light meter measures.

    ILLUMINANCE: of a plane, in lux, the integral of luminance times the cosine to the direction that the meter looks in.
    CYLINDRICAL: of an upright cylinder of no size, in lux: the mean over all horizontal directions of the illuminance of a
    plane that looks that way (EN 12665).

    >>> primray.MeterKind("cylindrical")
    <MeterKind.CYLINDRICAL: 'cylindrical'>
    """

    ILLUMINANCE = "illuminance"
    CYLINDRICAL = "cylindrical"


@dataclass(frozen=True)
class LightMeter:
    """A light meter at a point, in the stage's world space and scene units.

    `direction` is that in which it looks, of any length; of a cylinder it is the axis. None: up.

    >>> meter = primray.LightMeter("desk", (0.0, 0.75, 0.0))
    >>> meter.kind
    <MeterKind.ILLUMINANCE: 'illuminance'>
    """

    name: str
    position: Vector
    direction: Vector | None = None
    kind: MeterKind = MeterKind.ILLUMINANCE
    grid: str = ""  # the grid that it is one of

    def __post_init__(self) -> None:
        _check_name(self.name)
        object.__setattr__(self, "position", _vector(self.position, self.name, "position"))
        if self.direction is not None:
            object.__setattr__(self, "direction", _unit(self.direction, self.name))
        object.__setattr__(self, "kind", _kind(self.kind, self.name))


@dataclass(frozen=True)
class MeterGrid:
    """A grid of light meters on a rectangle: from `corner` along the sides `across` and `along`, in scene units.

    Meters are at the middles of equal cells. `counts` is how many there are along each side; None: as many as EN 12464-1 asks
    for by the sides' lengths in metres, with a `border` in metres left out (0.5, or nothing where a side is too short for it).
    Without a `direction` they look along across x along, whichever way of it points up more.

    >>> grid = primray.MeterGrid("desks", (0, 0.75, 0), (0, 0, -4), (5, 0, 0))
    >>> len(grid.meters())
    48
    """

    name: str
    corner: Vector
    across: Vector
    along: Vector
    counts: tuple[int, int] | None = None
    border: float | None = None
    direction: Vector | None = None
    kind: MeterKind = MeterKind.ILLUMINANCE

    def __post_init__(self) -> None:
        _check_name(self.name)
        for part in ("corner", "across", "along"):
            object.__setattr__(self, part, _vector(getattr(self, part), self.name, part))
        object.__setattr__(self, "kind", _kind(self.kind, self.name))
        if np.linalg.norm(np.cross(self.across, self.along)) == 0:
            raise SettingsError("a grid's sides must span a plane", where=self.name, code=CODE)
        if self.direction is not None:
            object.__setattr__(self, "direction", _unit(self.direction, self.name))
        if self.border is not None and not (_is_number(self.border) and self.border >= 0):
            raise SettingsError(f"a border is 0 or more, not {self.border!r}", where=self.name, code=CODE)
        if self.counts is not None:
            object.__setattr__(self, "counts", _counts(self.counts, self.name))

    def meters(self, *, meters_per_unit: float = 1.0, up: Vector = (0.0, 1.0, 0.0)) -> list[LightMeter]:
        """Return the grid's meters, row by row along `along`, named NAME[i,j] by their place along `across` and `along`."""
        corner, sides = np.array(self.corner), np.array([self.across, self.along])
        lengths = np.linalg.norm(sides, axis=1) * meters_per_unit
        borders = [self._border(float(length)) for length in lengths]
        inner = [float(length) - 2 * border for length, border in zip(lengths, borders, strict=True)]
        if self.counts is None:
            spacing = grid_spacing(max(inner))
            counts = tuple(max(1, math.ceil(side / spacing - 1e-9)) for side in inner)
        else:
            counts = self.counts
        if counts[0] * counts[1] > MOST_POINTS:
            message = f"a grid of {counts[0]} x {counts[1]} points is too large (at most {MOST_POINTS}): give counts"
            raise SettingsError(message, where=self.name, code=CODE)
        direction = self.direction
        if direction is None and self.kind is MeterKind.ILLUMINANCE:
            normal = np.cross(*sides)
            direction = as_vector(normal if normal @ np.array(up) >= 0 else -normal)
        steps = [
            [(border + side * (i + 0.5) / n) / float(length) for i in range(n)]
            for border, side, n, length in zip(borders, inner, counts, lengths, strict=True)
        ]
        return [
            LightMeter(
                f"{self.name}[{i},{j}]", as_vector(corner + s * sides[0] + t * sides[1]), direction, self.kind, self.name
            )
            for j, t in enumerate(steps[1])
            for i, s in enumerate(steps[0])
        ]

    def _border(self, length: float) -> float:
        if self.border is None:
            return BORDER if length > 2 * BORDER else 0.0
        if 2 * self.border >= length:
            raise SettingsError("the border leaves nothing of the grid", where=self.name, code=CODE)
        return self.border


@dataclass(frozen=True)
class Meters:
    """Light meters, and what was said of them: the scene's units and up axis are known."""

    meters: tuple[LightMeter, ...]
    up: Vector = field(default=(0.0, 1.0, 0.0))

    @classmethod
    def of(cls, given: Iterable[LightMeter | MeterGrid], meters_per_unit: float, up: Vector) -> Meters:
        """Return all meters of grids and single ones. SettingsError: two of the same name, or none at all."""
        found: list[LightMeter] = []
        if isinstance(given, LightMeter | MeterGrid):
            given = [given]
        if not isinstance(given, Iterable):
            raise SettingsError(f"light meters are LightMeter or MeterGrid, not {given!r}", where="meters", code=CODE)
        for one in given:
            if not isinstance(one, LightMeter | MeterGrid):
                raise SettingsError(f"a light meter is a LightMeter or a MeterGrid, not {one!r}", where="meters", code=CODE)
            found += one.meters(meters_per_unit=meters_per_unit, up=up) if isinstance(one, MeterGrid) else [one]
        if not found:
            raise SettingsError("there are no light meters: name points or grids, or put them on the stage", code=CODE)
        names = [meter.name for meter in found]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise SettingsError(f"two light meters have the name {twice}", where=twice, code=CODE)
        if len(found) > MOST_POINTS:
            raise SettingsError(f"{len(found)} light meters are too many (at most {MOST_POINTS})", code=CODE)
        return cls(tuple(found), up)

    def positions(self) -> Doubles:
        return np.array([meter.position for meter in self.meters], np.float64)

    def directions(self) -> Doubles:
        """Return unit directions (N, 3)."""
        return np.array([self.up if meter.direction is None else meter.direction for meter in self.meters], np.float64)


def grid_spacing(length: float) -> float:
    """Return the largest distance between points, in metres, of a grid whose longer side is `length` metres (EN 12464-1)."""
    return min(0.2 * 5 ** math.log10(max(length, 1e-3)), WIDEST)


def read_meters(path: str | os.PathLike[str]) -> list[LightMeter | MeterGrid]:
    """Return the meters and grids of a JSON file: a list of objects with the fields of LightMeter or of MeterGrid.

    SettingsError with the object's number: a field that neither has, or a value that it cannot take.
    """
    try:
        rows = json.loads(Path(path).read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"the file of light meters cannot be read: {error}", where=str(path), code=CODE) from None
    except ValueError as error:
        raise SettingsError(f"the file of light meters is no JSON: {error}", where=str(path), code=CODE) from None
    if not isinstance(rows, list):
        raise SettingsError("a file of light meters is a list of objects", where=str(path), code=CODE)
    return [_read_meter(row, f"{path}[{i}]") for i, row in enumerate(rows)]


def _read_meter(row: Any, where: str) -> LightMeter | MeterGrid:
    if not isinstance(row, Mapping):
        raise SettingsError("a light meter is an object", where=where, code=CODE)
    made: Any = MeterGrid if "corner" in row else LightMeter
    known = [name for name in made.__dataclass_fields__ if name != "grid"]
    for name in row:
        if name not in known:
            hint = did_you_mean(name, known) or f"there are {', '.join(known)}"
            raise SettingsError(f"a light meter has no {name}: {hint}", where=where, code=CODE)
    for name in made.__dataclass_fields__.values():
        if name.name in ("name", "position", "corner", "across", "along") and name.name not in row:
            raise SettingsError(f"a light meter needs a {name.name}", where=where, code=CODE)
    try:
        meter: LightMeter | MeterGrid = made(**{name: tuple(v) if isinstance(v, list) else v for name, v in row.items()})
    except TypeError as error:
        raise SettingsError(f"it is no light meter: {error}", where=where, code=CODE) from None
    return meter


def _kind(kind: Any, name: str) -> MeterKind:
    try:
        return MeterKind(kind)
    except ValueError:
        kinds = ", ".join(each.value for each in MeterKind)
        raise SettingsError(f"a light meter's kind is one of {kinds}, not {kind!r}", where=name, code=CODE) from None


def _vector(value: Any, name: str, part: str) -> Vector:
    try:
        found = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise SettingsError(f"{part} must be three finite numbers, not {value!r}", where=name, code=CODE)
    if part != "direction" and np.abs(found).max() > FARTHEST:
        raise SettingsError(f"{part} must be within {FARTHEST:g} of the origin, not {value!r}", where=name, code=CODE)
    return as_vector(found)


def _unit(value: Any, name: str) -> Vector:
    found = np.array(_vector(value, name, "direction"))
    largest = float(np.abs(found).max())
    if largest == 0:
        raise SettingsError("a direction must not be 0", where=name, code=CODE)
    found /= largest  # whose squares are finite
    return as_vector(found / np.linalg.norm(found))


def _check_name(name: Any) -> None:
    if not isinstance(name, str):
        raise SettingsError(f"a light meter's name is a text, not {name!r}", where="name", code=CODE)


def _counts(value: Any, name: str) -> tuple[int, int]:
    try:
        columns, rows = (operator.index(n) for n in value)
    except (TypeError, ValueError):
        columns = rows = 0
    if columns < 1 or rows < 1:
        raise SettingsError(f"counts are two numbers above 0, not {value}", where=name, code=CODE)
    return columns, rows


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


def as_vector(value: npt.ArrayLike) -> Vector:
    """Return three numbers as floats."""
    x, y, z = (float(v) for v in np.asarray(value, np.float64))
    return (x, y, z)
