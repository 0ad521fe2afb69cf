"""Patterns of lidars: in which directions they fire, and when.

A pattern is a table of channels that is fired at each of `steps` azimuths; one of a single step is a list of firings. Azimuths
are counter-clockwise about z, which is up, from x, which is forward; elevations are up from the x-y plane.
"""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..errors import LimitError, SettingsError, did_you_mean

MOST_FIRINGS = 1 << 26  # of a frame
CODE = "lidar-pattern"
COLUMNS = {"elevation_deg": "elevations", "azimuth_deg": "azimuths", "time_s": "times", "channel": "channel_numbers"}


@dataclass(frozen=True, eq=False)
class Firings:
    """All firings of one frame, in the order of their steps: each (N,), but `directions` (N, 3), unit, in the sensor's axes."""

    azimuth_deg: Doubles
    elevation_deg: Doubles
    time_s: Doubles  # after the frame's beginning
    channel: npt.NDArray[np.uint16]
    column: npt.NDArray[np.uint32]  # step
    directions: Doubles


@dataclass(frozen=True)
class LidarPattern:
    """Channels that are fired at each of `steps` azimuths of a sweep.

    `elevations_deg`, `azimuths_deg` and `times_s` have a value for each channel: its direction, its azimuth relative to the
    step's, and when it fires after the step begins; `channel_numbers` are what its points are marked with. A frame lasts
    1 / `rate_hz`, in which the head turns once: a step at azimuth a of `sweep_deg` (start, end; the end is left out) is fired
    |a - start| / 360 of that after the beginning. `range_m` is the nearest and the farthest distance that is measured.

    >>> pattern = primray.LidarPattern.rotating(elevations_deg=[-10, 0, 10], steps=900, rate_hz=20)
    >>> pattern.count, round(float(pattern.firings().time_s[-1]), 6)
    (2700, 0.049944)
    >>> primray.LidarPattern.named("rotating-32").count
    57600

    SettingsError `lidar-pattern` for values that no sensor has.
    """

    elevations_deg: tuple[float, ...]
    azimuths_deg: tuple[float, ...]
    times_s: tuple[float, ...]
    channel_numbers: tuple[int, ...]
    steps: int = 1
    sweep_deg: tuple[float, float] = (0.0, 360.0)
    clockwise: bool = False
    rate_hz: float = 10.0
    range_m: tuple[float, float] = (0.3, 200.0)

    def __post_init__(self) -> None:
        count = len(self.elevations_deg)
        _need(count > 0, "a pattern has one channel at least", "elevations")
        for name in ("azimuths_deg", "times_s", "channel_numbers"):
            own = len(getattr(self, name))
            _need(own == count, f"there are {count} elevations and {own} {name}: each channel has one", name)
        for name in ("elevations_deg", "azimuths_deg", "times_s", "sweep_deg"):
            _need(all(map(math.isfinite, getattr(self, name))), f"{name} has a value that is not finite", name)
        _need(all(abs(e) <= 90 for e in self.elevations_deg), "elevations are from -90 to 90 degrees", "elevations")
        _need(min(self.times_s) >= 0, "a channel fires 0 seconds or more after its step begins", "times")
        _need(all(0 <= n < 1 << 16 for n in self.channel_numbers), "channel numbers are from 0 to 65535", "channel_numbers")
        _need(self.steps >= 1, f"a pattern has one step at least, not {self.steps}", "steps")
        _need(0 < self.rate_hz < math.inf, f"the rate is above 0 Hz, not {self.rate_hz:g}", "rate")
        start, end = self.sweep_deg
        _need(start <= end and end - start <= 360, "a sweep ends where it starts or up to 360 degrees later", "sweep")
        near, far = self.range_m
        _need(0 <= near < far < math.inf, f"a range is from 0 or more to more than that, not {near:g} to {far:g} m", "range")
        if self.count > MOST_FIRINGS:
            sentence = f"a frame has up to {MOST_FIRINGS:,} firings, not {self.count:,}"
            raise LimitError(sentence, where="steps", code="lidar-firings")

    @property
    def count(self) -> int:
        """Number of firings of a frame."""
        return self.steps * len(self.elevations_deg)

    @property
    def duration_s(self) -> float:
        """Time from a frame's beginning to its last firing."""
        turn = (self.sweep_deg[1] - self.sweep_deg[0]) / 360 * (self.steps - 1) / self.steps
        return turn / self.rate_hz + max(self.times_s)

    @classmethod
    def rotating(
        cls,
        elevations_deg: Sequence[float],
        *,
        steps: int = 1800,
        rate_hz: float = 10.0,
        azimuths_deg: Sequence[float] | None = None,
        times_s: Sequence[float] | None = None,
        channel_numbers: Sequence[int] | None = None,
        sweep_deg: tuple[float, float] = (0.0, 360.0),
        clockwise: bool = False,
        range_m: tuple[float, float] = (0.3, 200.0),
    ) -> LidarPattern:
        """Return the pattern of a head that turns; values that are not given are 0, and channels are numbered from 0."""
        count = len(elevations_deg)
        return cls(
            tuple(map(float, elevations_deg)),
            tuple(map(float, azimuths_deg)) if azimuths_deg is not None else (0.0,) * count,
            tuple(map(float, times_s)) if times_s is not None else (0.0,) * count,
            tuple(map(int, channel_numbers)) if channel_numbers is not None else tuple(range(count)),
            steps,
            (float(sweep_deg[0]), float(sweep_deg[1])),
            clockwise,
            float(rate_hz),
            (float(range_m[0]), float(range_m[1])),
        )

    @classmethod
    def named(cls, name: str) -> LidarPattern:
        """Return a generic pattern; SettingsError `lidar-pattern` for a name that is none of NAMED."""
        if name not in NAMED:
            hint = did_you_mean(name, NAMED) or f"there are {', '.join(NAMED)}"
            raise SettingsError(f"no pattern is named {name!r}, and there is no such file; {hint}", where="pattern", code=CODE)
        return NAMED[name]()

    @classmethod
    def read(cls, file: str | os.PathLike[str]) -> LidarPattern:
        """Return the pattern of a .json file (members as in `of`), or of a .csv file of channels, which turn.

        A table's first row names its columns: elevation_deg, and where they differ azimuth_deg, time_s, channel.
        """
        path = Path(file)
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            raise SettingsError("there is no such file", where=str(path), code=CODE) from None
        except (OSError, UnicodeDecodeError) as error:
            raise SettingsError(f"the pattern cannot be read: {error}", where=str(path), code=CODE) from None
        if path.suffix.lower() == ".csv":
            return cls.of(_of_table(text, str(path)), str(path))
        try:
            values = json.loads(text)
        except ValueError as error:
            raise SettingsError(f"the pattern is no JSON: {error}", where=str(path), code=CODE) from None
        return cls.of(values, str(path))

    @classmethod
    def of(cls, values: Mapping[str, Any], where: str = "") -> LidarPattern:
        """Return the pattern with these members, all in degrees, seconds, hertz and metres.

        `pattern` (a name) or `table` (a file) is what the others change: `elevations`, or `channels` of them evenly in
        `elevation_range`; `azimuths`, `times`, `channel_numbers`; `steps`, `sweep`, `clockwise`, `rate`, `range`.
        """
        if not isinstance(values, Mapping):
            raise SettingsError("a pattern is an object with members such as elevations", where=where, code=CODE)
        for name, value in values.items():
            if name not in _CHECKS:
                hint = did_you_mean(str(name), _CHECKS) or f"it has {', '.join(_CHECKS)}"
                raise SettingsError(f"a pattern has no {name!r}; {hint}", where=where, code=CODE)
            if not _CHECKS[name](value):
                raise SettingsError(f"{name} cannot be {_shown(value)}", where=where, code=CODE)
        base = _base_of(values, where)
        elevations = values.get("elevations", base.elevations_deg)
        if "channels" in values or "elevation_range" in values:
            if "elevations" in values:
                raise SettingsError("elevations are listed, or so many channels in a range", where=where, code=CODE)
            low, high = values.get("elevation_range", (min(base.elevations_deg), max(base.elevations_deg)))
            elevations = np.linspace(low, high, values.get("channels", len(base.elevations_deg))).tolist()
        same = len(elevations) == len(base.elevations_deg)
        try:
            return cls.rotating(
                elevations,
                azimuths_deg=values.get("azimuths", base.azimuths_deg if same else None),
                times_s=values.get("times", base.times_s if same else None),
                channel_numbers=values.get("channel_numbers", base.channel_numbers if same else None),
                steps=values.get("steps", base.steps),
                sweep_deg=tuple(values.get("sweep", base.sweep_deg)),
                clockwise=values.get("clockwise", base.clockwise),
                rate_hz=values.get("rate", base.rate_hz),
                range_m=tuple(values.get("range", base.range_m)),
            )
        except SettingsError as error:
            raise SettingsError(error.message, where=where or error.where, code=CODE) from None

    def as_json(self) -> dict[str, Any]:
        """Return the members that `of` reads."""
        return {
            "elevations": list(self.elevations_deg),
            "azimuths": list(self.azimuths_deg),
            "times": list(self.times_s),
            "channel_numbers": list(self.channel_numbers),
            "steps": self.steps,
            "sweep": list(self.sweep_deg),
            "clockwise": self.clockwise,
            "rate": self.rate_hz,
            "range": list(self.range_m),
        }

    def firings(self) -> Firings:
        """Return the firings of a frame."""
        start, end = self.sweep_deg
        turned = (end - start) * np.arange(self.steps) / self.steps
        # Clockwise heads go through the same sector from its other sense: azimuths fall from the start.
        of_step = (-1.0 if self.clockwise else 1.0) * (start + turned)
        azimuth = (of_step[:, None] + np.array(self.azimuths_deg)).ravel()
        elevation = np.tile(self.elevations_deg, self.steps)
        time = (turned[:, None] / 360 / self.rate_hz + np.array(self.times_s)).ravel()
        a, e = np.radians(azimuth), np.radians(elevation)
        flat = np.cos(e)
        directions = np.stack([flat * np.cos(a), flat * np.sin(a), np.sin(e)], axis=1)
        channel = np.tile(np.array(self.channel_numbers, np.uint16), self.steps)
        column = np.repeat(np.arange(self.steps, dtype=np.uint32), len(self.elevations_deg))
        return Firings(np.mod(azimuth, 360.0), elevation, time, channel, column, directions)


def _need(holds: bool, sentence: str, where: str) -> None:
    if not holds:
        raise SettingsError(sentence, where=where, code=CODE)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_list(value: Any, each: Callable[[Any], bool] = _is_number, size: int | None = None) -> bool:
    return isinstance(value, list | tuple) and all(map(each, value)) and size in (None, len(value))


def _is_pair(value: Any) -> bool:
    return _is_list(value, size=2)


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


_CHECKS: dict[str, Callable[[Any], bool]] = {
    "pattern": _is_text,
    "table": _is_text,
    "elevations": _is_list,
    "azimuths": _is_list,
    "times": _is_list,
    "channel_numbers": lambda value: _is_list(value, _is_whole),
    "channels": lambda value: _is_whole(value) and 1 <= value <= 1 << 16,
    "elevation_range": _is_pair,
    "steps": _is_whole,
    "sweep": _is_pair,
    "clockwise": lambda value: isinstance(value, bool),
    "rate": _is_number,
    "range": _is_pair,
}


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _base_of(values: Mapping[str, Any], where: str) -> LidarPattern:
    """Return the pattern that others of the values change."""
    if "pattern" in values and "table" in values:
        raise SettingsError("a pattern is named, or the table of a file", where=where, code=CODE)
    if "table" in values:
        table = Path(where).parent / values["table"]
        if table.suffix.lower() != ".csv":
            raise SettingsError(f"a table is a .csv file, not {values['table']!r}", where=where, code=CODE)
        return LidarPattern.read(table)
    return LidarPattern.named(values.get("pattern", DEFAULT))


def _of_table(text: str, where: str) -> dict[str, Any]:
    """Return the members that a CSV table of channels says."""
    rows = [row for row in csv.reader(text.splitlines()) if row and not row[0].lstrip().startswith("#")]
    names = [name.strip() for name in rows[0]] if rows else []
    unknown = [name for name in names if name not in COLUMNS]
    if "elevation_deg" not in names or unknown:
        wrong = f"not {', '.join(map(repr, unknown))}" if unknown else "and elevation_deg must be there"
        raise SettingsError(f"the first row names columns of {', '.join(COLUMNS)}, {wrong}", where=where, code=CODE)
    columns: dict[str, list[Any]] = {COLUMNS[name]: [] for name in names}
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise SettingsError(f"row {line} has {len(row)} values for {len(names)} columns", where=where, code=CODE)
        for name, value in zip(names, row, strict=True):
            try:
                columns[COLUMNS[name]].append(int(value) if name == "channel" else float(value))
            except ValueError:
                raise SettingsError(f"row {line}: {name} cannot be {value!r}", where=where, code=CODE) from None
    if len(rows) < 2:
        raise SettingsError("the table has no channels", where=where, code=CODE)
    count = len(rows) - 1
    defaults = {"azimuths": [0.0] * count, "times": [0.0] * count, "channel_numbers": list(range(count))}
    return defaults | columns


def _rotating(channels: int, low: float, high: float, steps: int = 1800, far: float = 200.0) -> Callable[[], LidarPattern]:
    return lambda: LidarPattern.rotating(np.linspace(low, high, channels).tolist(), steps=steps, range_m=(0.3, far))


def _vlp_16() -> LidarPattern:
    # Velodyne's VLP-16 manual: elevations in the order in which lasers fire, every 2.304 us, a cycle every 55.296 us.
    elevations = [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15]
    order = sorted(range(16), key=lambda k: elevations[k])
    return LidarPattern.rotating(
        elevations,
        steps=1808,
        times_s=[2.304e-6 * k for k in range(16)],
        channel_numbers=[order.index(k) for k in range(16)],
        clockwise=True,
        range_m=(0.3, 100.0),
    )


def _flash() -> LidarPattern:
    elevation, azimuth = np.meshgrid(np.linspace(-12.5, 12.5, 64), np.linspace(-60, 60, 256), indexing="ij")
    numbers = np.repeat(np.arange(64), 256)
    return LidarPattern.rotating(
        elevation.ravel().tolist(), steps=1, azimuths_deg=azimuth.ravel().tolist(), channel_numbers=numbers.tolist()
    )


NAMED: dict[str, Callable[[], LidarPattern]] = {
    "rotating-16": _rotating(16, -15, 15, far=100.0),
    "rotating-32": _rotating(32, -25, 15),
    "rotating-64": _rotating(64, -22.5, 22.5),
    "rotating-128": _rotating(128, -22.5, 22.5, steps=2048),
    "vlp-16": _vlp_16,
    "flash-64": _flash,
}
DEFAULT = "rotating-32"
