"""Photometric files (IES LM-63-1986, -1991, -1995, -2002, -2019) read as an IesProfile; independent of USD and of the core.

The frame of a profile, by LM-63-2002 section 3: z points up, nadir (vertical angle 0 of types C and B, -90 of type A) is along
-z, photometric horizontal along +x; seen from above, horizontal angles turn counterclockwise in type C, clockwise in types A
and B. A light has z along its Z, and x along its -X: horizontal angle 0 is there in OpenUSD's reference implementation
(hdEmbree: phi = atan2(wI.y, wI.x) of the direction *towards* the light, theta = acos(wI.z)) and in the stages with which that
was compared with Karma and RenderMan (pmolodo/luxtest, usd/iesTest.usda: the camera at 0 degrees looks along -X).

UsdLux leaves the following open: intensities are multiplied by the candela multiplier, ballast factor and ballast-lamp
photometric factor (except for -2019, which stores the file's generation type there), and not by lamps or lumens, which
describe the measurement. TILT describes how lamps depend on the luminaire's tilt and is skipped, since candela are given for
the tested position.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles
from ..description.lighting import IesProfile

MAX_BYTES = 16 << 20
MAX_ANGLES = 4096  # horizontal or vertical
MAX_INTENSITIES = 1 << 21
_BRIGHTEST = 1e12  # candela
_CLOSE_DEG = 1e-3
_HEMISPHERE = math.pi / 2 + 0.1  # radians: up to this vertical range, power is that of a hemisphere (hdEmbree, pxrIES.cpp)
_SEPARATORS = re.compile(r"[\s,]+")


class IesError(ValueError):
    """An unusable photometric file; the message names the line."""


@dataclass(frozen=True)
class IesFile:
    """The profile of a photometric file, and notes about what was corrected or ignored."""

    profile: IesProfile
    notes: tuple[str, ...]  # corrections, and parts that are ignored


def parse_ies(content: bytes) -> IesFile:
    """Return the profile in a file's bytes; IesError if they are not LM-63."""
    if len(content) > MAX_BYTES:
        raise IesError(f"it has {len(content)} bytes, more than {MAX_BYTES}")
    lines = content.decode("latin-1").splitlines()
    tilt = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT=")), None)
    if tilt is None:
        raise IesError("no line begins with TILT=: this is not an LM-63 file")
    numbers = _Numbers(lines, tilt + 1)
    notes: list[str] = []
    how = lines[tilt].strip()[len("TILT=") :].strip()
    if how.upper() == "INCLUDE":
        _skip_tilt(numbers)
    elif how.upper() != "NONE":
        notes.append(f"TILT={how}: the lamp's dependence on tilt is ignored")
    is_2019 = any("LM-63-2019" in line.upper() for line in lines[:tilt])
    table = _table(numbers, is_2019, notes)
    rest = numbers.left()
    if rest:
        notes.append(f"{rest} values after the last intensity are ignored")
    return IesFile(_profile(table, notes), tuple(notes))


class _Numbers:
    """The numbers below the TILT line, in order, each with its line number."""

    def __init__(self, lines: Sequence[str], first: int) -> None:
        self._words = [
            (word, first + i + 1)
            for i, line in enumerate(lines[first:])
            for word in _SEPARATORS.split(line.replace("\x1a", " "))
            if word
        ]
        self._at = 0
        self._end = len(lines)

    def next(self, what: str) -> float:
        if self._at == len(self._words):
            raise IesError(f"line {self._end}: the file ends before {what}")
        word, line = self._words[self._at]
        self._at += 1
        try:
            found = float(word)
        except ValueError:
            found = math.nan
        if not math.isfinite(found):
            raise IesError(f"line {line}: {word[:40]!r} is not a number ({what})")
        return found

    def count(self, what: str, low: int, high: int) -> int:
        found = self.next(what)
        if found != int(found) or not low <= found <= high:
            raise IesError(f"line {self.line()}: {what} is {found:g}, not a whole number from {low} to {high}")
        return int(found)

    def several(self, count: int, what: str) -> Doubles:
        return np.array([self.next(f"{what} {i + 1} of {count}") for i in range(count)], np.float64)

    def line(self) -> int:
        """Return the line of the last number read."""
        return self._words[self._at - 1][1]

    def left(self) -> int:
        return len(self._words) - self._at


def _skip_tilt(numbers: _Numbers) -> None:
    numbers.next("the lamp-to-luminaire geometry")
    pairs = numbers.count("the number of tilt angles", 0, MAX_ANGLES)
    numbers.several(pairs, "tilt angle")
    numbers.several(pairs, "tilt factor")


@dataclass(frozen=True)
class _Table:
    """Angles as in the file, in degrees; candela (H, V) include the multipliers."""

    kind: str  # A, B or C
    vertical: Doubles
    horizontal: Doubles
    candela: Doubles


def _table(numbers: _Numbers, is_2019: bool, notes: list[str]) -> _Table:
    numbers.next("the number of lamps")
    numbers.next("the lumens per lamp")
    factor = numbers.next("the candela multiplier")
    verticals = numbers.count("the number of vertical angles", 2, MAX_ANGLES)
    horizontals = numbers.count("the number of horizontal angles", 1, MAX_ANGLES)
    if verticals * horizontals > MAX_INTENSITIES:
        raise IesError(f"line {numbers.line()}: {verticals} x {horizontals} intensities are more than {MAX_INTENSITIES}")
    kind = "CBA"[numbers.count("the photometric type", 1, 3) - 1]
    for what in ("the units type", "the width", "the length", "the height"):
        numbers.next(what)
    factor *= numbers.next("the ballast factor")
    ballast_lamp = numbers.next("the ballast-lamp photometric factor")
    factor *= 1.0 if is_2019 else ballast_lamp
    numbers.next("the input watts")
    vertical = _angles(numbers, verticals, "vertical angle", *((0.0, 180.0) if kind == "C" else (-90.0, 90.0)))
    horizontal = _angles(numbers, horizontals, "horizontal angle", *((0.0, 360.0) if kind == "C" else (-90.0, 90.0)))
    candela = numbers.several(verticals * horizontals, "intensity").reshape(horizontals, verticals) * factor
    if np.abs(candela).max() > _BRIGHTEST:
        raise IesError(f"an intensity is {np.abs(candela).max():g} candela, more than {_BRIGHTEST:g}")
    dark = int((candela < 0).sum())
    if dark:
        notes.append(f"{dark} intensities are negative: they are taken as 0")
    return _Table(kind, vertical, horizontal, np.maximum(candela, 0.0))


def _angles(numbers: _Numbers, count: int, what: str, low: float, high: float) -> Doubles:
    found: list[float] = []
    for i in range(count):
        angle = numbers.next(f"{what} {i + 1} of {count}")
        if not low - _CLOSE_DEG <= angle <= high + _CLOSE_DEG:
            raise IesError(f"line {numbers.line()}: {what} {angle:g} is outside [{low:g}, {high:g}]")
        if found and angle <= found[-1]:
            raise IesError(f"line {numbers.line()}: {what}s do not ascend ({angle:g} after {found[-1]:g})")
        found.append(angle)
    angles: Doubles = np.clip(np.array(found), low, high)
    return angles


def _profile(t: _Table, notes: list[str]) -> IesProfile:
    if t.kind == "B":
        vertical, horizontal, candela = _type_b(t)
        return _profile_of(vertical, horizontal, candela, horizontal_pole=True)
    if len(t.horizontal) == 1:
        horizontal, candela = np.zeros(1), t.candela
    elif t.kind == "A":
        horizontal, candela = _type_a_planes(t)
    else:
        horizontal, candela = _type_c_planes(t, notes)
    return _profile_of(t.vertical + (90.0 if t.kind == "A" else 0.0), horizontal, candela, horizontal_pole=False)


def _profile_of(vertical: Doubles, horizontal: Doubles, candela: Doubles, horizontal_pole: bool) -> IesProfile:
    power = profile_power(vertical, horizontal, candela, horizontal_pole)
    return IesProfile(
        vertical.astype(np.float32), horizontal.astype(np.float32), candela.astype(np.float32), power, horizontal_pole
    )


def profile_power(vertical_deg: Doubles, horizontal_deg: Doubles, candela: Doubles, horizontal_pole: bool = False) -> float:
    """Return the sum over patches of mean intensity times solid angle, over 4 pi or 2 pi.

    It is 2 pi where vertical angles span no more than a hemisphere. A patch's sine is taken at its centre, as in hdEmbree's
    pxrIES.cpp; UsdLux leaves all of this open.
    """
    if len(horizontal_deg) == 1:
        horizontal_deg, candela = np.array([0.0, 360.0]), np.concatenate([candela, candela])
    v, h = np.radians(vertical_deg), np.radians(horizontal_deg)
    dv, dh = np.diff(v), np.diff(h)
    mean = (candela[:-1, :-1] + candela[1:, :-1] + candela[:-1, 1:] + candela[1:, 1:]) / 4
    sine = np.cos(h[:-1] + dh / 2)[:, None] if horizontal_pole else np.sin(v[:-1] + dv / 2)[None]
    total = float(np.sum(mean * dh[:, None] * dv[None] * sine))
    return total / (math.pi * (4 if v[-1] - v[0] > _HEMISPHERE else 2))


def _is(angle: float, wanted: float) -> bool:
    return abs(angle - wanted) < _CLOSE_DEG


def _mirrored(horizontal: Doubles, candela: Doubles, about: float) -> tuple[Doubles, Doubles]:
    """Return the planes with their mirror image at `about`, beyond the last plane or before the first."""
    if _is(float(horizontal[-1]), about):
        return np.concatenate([horizontal, (2 * about - horizontal)[-2::-1]]), np.concatenate([candela, candela[-2::-1]])
    return np.concatenate([(2 * about - horizontal)[:0:-1], horizontal]), np.concatenate([candela[:0:-1], candela])


def _type_c_planes(t: _Table, notes: list[str]) -> tuple[Doubles, Doubles]:
    """Return planes from 0 to 360 degrees.

    The last plane gives the symmetry: 90 by quadrants, 180 about the plane 0-180; from 90 to 270 (LM-63-1995) about the plane
    90-270.
    """
    horizontal, candela = t.horizontal, t.candela
    first, last = float(horizontal[0]), float(horizontal[-1])
    if _is(first, 0) and _is(last, 90):
        horizontal, candela = _mirrored(horizontal, candela, 90.0)
        return _mirrored(horizontal, candela, 180.0)
    if _is(first, 0) and _is(last, 180):
        return _mirrored(horizontal, candela, 180.0)
    if _is(first, 90) and _is(last, 270):
        horizontal, candela = _mirrored(horizontal, candela, 270.0)  # 90 to 450
        return _around(horizontal, candela)
    gap = first + 360.0 - last
    if gap <= _CLOSE_DEG:
        return horizontal, candela
    steps = np.diff(horizontal)
    if _is(gap, float(steps[0])) or _is(gap, float(steps[-1])):  # the last plane is missing, as it equals the first
        return _around(np.append(horizontal, first + 360.0), np.concatenate([candela, candela[:1]]))
    notes.append(f"its planes cover {first:g} to {last:g} degrees only: there is no light outside of them")
    return _with_gap(horizontal, candela)


def _type_a_planes(t: _Table) -> tuple[Doubles, Doubles]:
    """Return the planes of type A as type C: plane h is -h, since A counts clockwise; there is no light behind.

    Planes from 0 on are symmetric about the plane 0.
    """
    horizontal, candela = t.horizontal, t.candela
    if _is(float(horizontal[0]), 0):
        horizontal, candela = _mirrored(horizontal, candela, 0.0)
    return _with_gap(-horizontal[::-1], candela[::-1])


def _type_b(t: _Table) -> tuple[Doubles, Doubles, Doubles]:
    """Return angles and candela with both sides: angles from 0 on are mirrored, as in Cycles' reader, which hdEmbree uses."""
    vertical, horizontal, candela = t.vertical, t.horizontal, t.candela
    if len(horizontal) == 1:
        raise IesError("a file of photometric type B needs more than one horizontal angle")
    if _is(float(horizontal[0]), 0):
        horizontal, candela = _mirrored(horizontal, candela, 0.0)
    if _is(float(vertical[0]), 0):
        vertical, turned = _mirrored(vertical, candela.T, 0.0)
        candela = turned.T
    return vertical, horizontal, candela


def _with_gap(horizontal: Doubles, candela: Doubles) -> tuple[Doubles, Doubles]:
    """Return planes all around, dark between the last plane and the first; two planes at one angle are a step."""
    dark = np.zeros_like(candela[:1])
    angles = np.concatenate([horizontal, horizontal[-1:], horizontal[:1] + 360.0, horizontal[:1] + 360.0])
    return _around(angles, np.concatenate([candela, dark, dark, candela[:1]]))


def _around(horizontal: Doubles, candela: Doubles) -> tuple[Doubles, Doubles]:
    """Return planes over any 360 degrees as planes from 0 to 360."""
    if _is(float(horizontal[0]), 0):
        return horizontal, candela
    # Repeat the planes over three turns, and cut at 0 and 360 by linear interpolation.
    angles = np.concatenate([horizontal[:-1] - 360.0, horizontal[:-1], horizontal + 360.0])
    planes = np.concatenate([candela[:-1], candela[:-1], candela])
    inside = (angles > _CLOSE_DEG) & (angles < 360.0 - _CLOSE_DEG)
    i = int(np.searchsorted(angles, 0.0, side="right")) - 1
    part = (0.0 - angles[i]) / (angles[i + 1] - angles[i])
    cut = (planes[i] * (1 - part) + planes[i + 1] * part)[None]
    return np.concatenate([[0.0], angles[inside], [360.0]]), np.concatenate([cut, planes[inside], cut])
