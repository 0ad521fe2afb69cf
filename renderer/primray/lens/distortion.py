"""Lens distortion: the film point of a direction. Held by `camera` (part of the description).

Film coordinates are in units of the focal length, +y up: without distortion (x, y) is the point at unit distance. Directions
are in camera space, which looks along -Z. The core has the inverses, scene/distortion.cpp.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any
from zlib import compress, decompress

import numpy as np

from ..arrays import Doubles, Floats

SCAN_STEPS = 4096  # steps of the search for a model's turning point, as in the core
HALVINGS = 64
LARGEST_RADIUS = 1e4  # largest radius on the film
_AROUND = 16  # directions in half a turn
_COARSE = 64  # directions per side of a table among which the nearest is searched


class DistortionModel(Enum):
    """Model of lens distortion: the meaning of `Distortion.coefficients`.

    RATIONAL: OpenCV's pinhole, k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4. ANGLE_TO_RADIUS: the radius on the film is k0 a + k1 a^3 +
    k2 a^5 + k3 a^7 + k4 a^9 of the angle to the axis. RADIUS_TO_ANGLE: the angle is k0 + k1 r + k2 r^2 + k3 r^3 + k4 r^4 of the
    radius. TABLE: directions. RAYS: a place and a direction for each texel, the same all over it, as of many sensors at once.

    LAT_LONG: the film point is the longitude and the latitude in radians. k0 is the distance of two eyes in scene units, 0 for
    one. k1 is 0 where the left eye's picture is above the right one's, 1 where it is left of it; k2 is half the extent of one
    of them in that direction. k1 2 is one of the eyes alone, the left one if k2 is -1. CUBE: faces +X -X +Y -Y +Z -Z of width
    1, in k0 columns, from (0, 0) right and down.

    >>> primray.DistortionModel("rational")
    <DistortionModel.RATIONAL: 'rational'>
    """

    RATIONAL = "rational"
    ANGLE_TO_RADIUS = "angle-to-radius"
    RADIUS_TO_ANGLE = "radius-to-angle"
    TABLE = "table"
    RAYS = "rays"
    LAT_LONG = "lat-long"
    CUBE = "cube"


COEFFICIENT_COUNTS = {
    DistortionModel.RATIONAL: 12,
    DistortionModel.ANGLE_TO_RADIUS: 5,
    DistortionModel.RADIUS_TO_ANGLE: 5,
    DistortionModel.TABLE: 0,
    DistortionModel.RAYS: 0,
    DistortionModel.LAT_LONG: 3,
    DistortionModel.CUBE: 1,
}
WITH_TABLE = (DistortionModel.TABLE, DistortionModel.RAYS)
# Each face's right and up in camera space, seen from within, as OpenEXR has them (ImfEnvmap), in one column.
CUBE_FACES = {
    "+X": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "-X": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "+Y": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "-Y": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "+Z": ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "-Z": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
}


@dataclass(frozen=True, eq=False)
class DirectionTable:
    """Table of directions at texel centres, interpolated linearly, unless each is a ray from a place of its own.

    >>> ahead = np.full((2, 2, 3), (0.0, 0.0, -1.0), np.float32)
    >>> primray.DirectionTable((-1.0, 1.0, -1.0, 1.0), ahead).at(np.zeros((1, 2))).tolist()
    [[0.0, 0.0, -1.0]]
    """

    window: tuple[float, float, float, float]  # left, right, bottom, top of the table on the film
    directions: Floats  # (rows, columns, 3) of unit length, first row at the top; NaN where the lens sees nothing
    places: Floats | None = None  # (rows, columns, 3) in camera space, in scene units; for the model RAYS

    def at(self, film: Doubles) -> Doubles:
        """Return directions (N, 3) of film points (N, 2), not normalized; NaN outside of the table."""
        left, right, bottom, top = self.window
        rows, columns, _ = self.directions.shape
        column = (film[:, 0] - left) / (right - left) * columns - 0.5
        row = (top - film[:, 1]) / (top - bottom) * rows - 0.5
        i = np.clip(np.floor(np.nan_to_num(column)), 0, max(columns - 2, 0)).astype(np.int64)
        j = np.clip(np.floor(np.nan_to_num(row)), 0, max(rows - 2, 0)).astype(np.int64)
        s, t = (column - i)[:, None], (row - j)[:, None]
        d = self.directions.astype(np.float64, copy=False)
        below, beside = np.minimum(j + 1, rows - 1), np.minimum(i + 1, columns - 1)
        upper, lower = d[j, i] * (1 - s) + d[j, beside] * s, d[below, i] * (1 - s) + d[below, beside] * s
        return np.asarray(upper * (1 - t) + lower * t)


@dataclass(frozen=True, eq=False)
class Distortion:
    """Distortion of a camera's lens: a model, its coefficients, and the largest visible angle from the axis.

    >>> fisheye = primray.Distortion(primray.DistortionModel.ANGLE_TO_RADIUS, (1.0, -0.01, 0.0, 0.0, 0.0), 100.0)
    >>> fisheye.project([[0.0, 0.0, -1.0]]).tolist()
    [[0.0, 0.0]]
    """

    model: DistortionModel
    coefficients: tuple[float, ...]
    most_angle_deg: float = 180.0
    table: DirectionTable | None = None  # for the models TABLE and RAYS

    @property
    def has_eyes(self) -> bool:
        """Whether two eyes see, each from its own side: a film point then is of a position, not of a direction alone."""
        return self.model is DistortionModel.LAT_LONG and self.coefficients[0] != 0

    def project(self, directions: Any, *, right_eye: bool = False) -> Doubles:
        """Return film points (N, 2) of directions (N, 3) of any length; NaN for directions that the lens does not see.

        Rays of a table see points, no directions: all are NaN. Where two eyes see, `directions` are positions in camera space,
        and the points are in the left eye's picture, or in the right one's.
        """
        d = np.atleast_2d(np.asarray(directions, np.float64))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            if self.model is DistortionModel.RATIONAL:
                return self._rational(d)
            if self.model is DistortionModel.RAYS:
                return np.full((len(d), 2), np.nan)
            if self.model is DistortionModel.TABLE:
                return self._looked_up(d)
            if self.model is DistortionModel.LAT_LONG:
                return self._lat_long(d, 1.0 if right_eye else -1.0)
            if self.model is DistortionModel.CUBE:
                return self._on_cube(d)
            across = np.hypot(d[:, 0], d[:, 1])
            radius = self._radius(np.arctan2(across, -d[:, 2]))
            return np.asarray(
                np.where(across > 0, radius / across, np.where(np.isnan(radius), np.nan, 0.0))[:, None] * d[:, :2]
            )

    def _lat_long(self, d: Doubles, side: float) -> Doubles:
        """Return longitude and latitude; with two eyes, those in which the eye on that side sees a position."""
        distance, side_by_side, half = self.coefficients
        across = np.hypot(d[:, 0], d[:, 2])
        around = longitude = np.arctan2(d[:, 0], -d[:, 2])
        latitude = np.arctan2(d[:, 1], across)
        if not self.has_eyes:
            return np.stack([longitude, latitude], axis=1)
        if side_by_side == 2:
            side = -1.0 if half < 0 else 1.0
        for _ in range(HALVINGS):
            aside = 0.5 * distance * side * np.maximum(np.cos(latitude), 0.0)
            longitude = around - np.arcsin(aside / across)  # NaN within the circle of the eyes
            latitude = np.arctan2(d[:, 1], np.sqrt(across**2 - aside**2))
        longitude = np.remainder(longitude + np.pi, 2 * np.pi) - np.pi
        if side_by_side == 2:
            return np.stack([longitude, latitude], axis=1)
        shift = (side * half, 0.0) if side_by_side else (0.0, -side * half)
        return np.stack([longitude, latitude], axis=1) + shift

    def _on_cube(self, d: Doubles) -> Doubles:
        axis = np.abs(d).argmax(axis=1)
        largest = d[np.arange(len(d)), axis]
        face = 2 * axis + (largest < 0)
        right, up = (np.array([vectors[k] for vectors in CUBE_FACES.values()])[face] for k in (0, 1))
        u, v = ((d * along).sum(axis=1) / np.abs(largest) for along in (right, up))
        row, column = np.divmod(face, int(self.coefficients[0]))
        return np.stack([column + 0.5 + 0.5 * u, -row - 0.5 + 0.5 * v], axis=1)

    def _radius(self, angle: Doubles) -> Doubles:
        k, most = self.coefficients, np.radians(min(self.most_angle_deg, 180.0))
        if self.model is DistortionModel.ANGLE_TO_RADIUS:
            end = first_turn(most, lambda a: _odd_slope(k, a))
            return np.asarray(np.where(angle <= end, _odd(k, angle), np.nan))
        end = self._farthest(most)
        low, high = np.zeros_like(angle), np.full_like(angle, end)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            before = _polynomial(k, middle) < angle
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        seen = (angle >= k[0]) & (angle <= _polynomial(k, np.array([end]))[0])
        return np.asarray(np.where(seen, 0.5 * (low + high), np.nan))

    def _farthest(self, most: float) -> float:
        """Return the radius up to which the angle grows and is at most `most`."""
        k, end = self.coefficients, 1.0
        while end < LARGEST_RADIUS and _polynomial(k, np.array([end]))[0] < most and _slope(k, np.array([end]))[0] > 0:
            end *= 2
        return first_turn(end, lambda r: np.where(_polynomial(k, r) <= most, _slope(k, r), -1.0))

    def _rational(self, d: Doubles) -> Doubles:
        """Return film points by OpenCV's model (calib3d, "Detailed Description"), whose y is down."""
        x, y = d[:, 0] / -d[:, 2], d[:, 1] / d[:, 2]
        k, most = self.coefficients, np.radians(min(self.most_angle_deg, 90.0))
        u, v = _rational(k, x, y)[:2]
        end = min(float(_tangent(np.array([first_turn(most, lambda a: _unfolds(k, _tangent(a)))]))[0]), LARGEST_RADIUS)
        seen = (d[:, 2] < 0) & (np.hypot(x, y) <= end)
        return np.stack([np.where(seen, u, np.nan), np.where(seen, -v, np.nan)], axis=1)

    def _looked_up(self, d: Doubles) -> Doubles:
        """Return film points by Newton iteration from the nearest of a subset of the table's directions."""
        assert self.table is not None
        table = self.table
        left, right, bottom, top = table.window
        rows, columns, _ = table.directions.shape
        some = np.ix_(*(np.unique(np.linspace(0, n - 1, min(n, _COARSE)).round().astype(int)) for n in (rows, columns)))
        known = np.nan_to_num(table.directions[some].astype(np.float64), nan=0.0)
        unit = d / np.linalg.norm(d, axis=1, keepdims=True)
        nearest = np.concatenate(
            [(part @ known.reshape(-1, 3).T).argmax(axis=1) for part in np.array_split(unit, len(d) // 4096 + 1)]
        )
        j, i = some[0][:, 0][nearest // known.shape[1]], some[1][0][nearest % known.shape[1]]
        film = np.stack([left + (i + 0.5) / columns * (right - left), top - (j + 0.5) / rows * (top - bottom)], axis=1)
        step = np.array([(right - left) / columns, (top - bottom) / rows]) * 1e-3
        u = np.cross(unit, np.where(np.abs(unit[:, :1]) < 0.5, [1.0, 0, 0], [0, 1.0, 0]))
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        v = np.cross(unit, u)
        for _ in range(HALVINGS // 2):
            film = film - _newton(table, film, step, u, v)
        found = table.at(film)
        found /= np.linalg.norm(found, axis=1, keepdims=True)
        inside = (film >= [left, bottom]).all(axis=1) & (film <= [right, top]).all(axis=1)
        seen = inside & (np.linalg.norm(found - unit, axis=1) < 1e-9) & (-unit[:, 2] >= np.cos(np.radians(self.most_angle_deg)))
        return np.where(seen[:, None], film, np.nan)


def _newton(table: DirectionTable, film: Doubles, step: Doubles, u: Doubles, v: Doubles) -> Doubles:
    """Return the Newton step of film points (N, 2) whose wanted directions are perpendicular to both u and v (N, 3)."""

    def off(at: Doubles) -> Doubles:
        found = table.at(at)
        found /= np.linalg.norm(found, axis=1, keepdims=True)
        return np.stack([(found * u).sum(axis=1), (found * v).sum(axis=1)], axis=1)

    here = off(film)
    by_x, by_y = (off(film + [step[0], 0]) - here) / step[0], (off(film + [0, step[1]]) - here) / step[1]
    det = by_x[:, 0] * by_y[:, 1] - by_x[:, 1] * by_y[:, 0]
    dx = (here[:, 0] * by_y[:, 1] - here[:, 1] * by_y[:, 0]) / det
    dy = (here[:, 1] * by_x[:, 0] - here[:, 0] * by_x[:, 1]) / det
    return np.stack([dx, dy], axis=1)


def first_turn(end: float, slope: Callable[[Doubles], Any]) -> float:
    """Return the first x in (0, end] at which `slope` is not positive; `end` if there is none."""
    x = end * np.arange(1, SCAN_STEPS + 1) / SCAN_STEPS
    turned = np.flatnonzero(~(np.asarray(slope(x)) > 0))
    if not len(turned):
        return end
    low, high = end * turned[0] / SCAN_STEPS, float(x[turned[0]])
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.asarray(slope(np.array([middle])))[0] > 0 else (low, middle)
    return float(low)


def _odd(k: tuple[float, ...], a: Doubles) -> Doubles:
    s = a * a
    return np.asarray(a * (k[0] + s * (k[1] + s * (k[2] + s * (k[3] + s * k[4])))))


def _odd_slope(k: tuple[float, ...], a: Doubles) -> Doubles:
    s = a * a
    return np.asarray(k[0] + s * (3 * k[1] + s * (5 * k[2] + s * (7 * k[3] + s * 9 * k[4]))))


def _polynomial(k: tuple[float, ...], r: Doubles) -> Doubles:
    return np.asarray(k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * k[4]))))


def _slope(k: tuple[float, ...], r: Doubles) -> Doubles:
    return np.asarray(k[1] + r * (2 * k[2] + r * (3 * k[3] + r * 4 * k[4])))


def _tangent(angle: Doubles) -> Doubles:
    return np.asarray(np.where(np.cos(angle) * LARGEST_RADIUS > np.sin(angle), np.tan(angle), LARGEST_RADIUS))


def _rational(k: tuple[float, ...], x: Doubles, y: Doubles) -> tuple[Doubles, Doubles, Doubles]:
    """Return the film point of (x, y), and the Jacobian determinant there."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = k
    s = x * x + y * y
    above, below = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
    g = above / below
    slope = ((k1 + s * (2 * k2 + s * 3 * k3)) * below - above * (k4 + s * (2 * k5 + s * 3 * k6))) / (below * below)
    u = x * g + 2 * p1 * x * y + p2 * (s + 2 * x * x) + s1 * s + s2 * s * s
    v = y * g + p1 * (s + 2 * y * y) + 2 * p2 * x * y + s3 * s + s4 * s * s
    prism_x, prism_y = s1 + 2 * s2 * s, s3 + 2 * s4 * s
    xx = g + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x + 2 * x * prism_x
    xy = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * y * prism_x
    yx = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * x * prism_y
    yy = g + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x + 2 * y * prism_y
    return u, v, xx * yy - xy * yx


def _rational_slope(k: tuple[float, ...], r: Doubles) -> Doubles:
    """Return the radial part's slope; negative beyond a pole."""
    s = r * r
    above, below = 1 + s * (k[0] + s * (k[1] + s * k[4])), 1 + s * (k[5] + s * (k[6] + s * k[7]))
    above_slope, below_slope = k[0] + s * (2 * k[1] + s * 3 * k[4]), k[5] + s * (2 * k[6] + s * 3 * k[7])
    return np.asarray(np.where(below > 0, (above + 2 * s * above_slope - above * 2 * s * below_slope / below) / below, -1.0))


def _unfolds(k: tuple[float, ...], r: Doubles) -> Doubles:
    """Return a value that is positive while the model is injective within these radii, as in the core."""
    least = _rational_slope(k, r)
    if not any(k[i] for i in (2, 3, 8, 9, 10, 11)):
        return least
    of_all = np.full_like(r, np.inf)
    for angle in np.pi * np.arange(_AROUND) / _AROUND:
        for side in (-r, r):
            of_all = np.minimum(of_all, _rational(k, side * np.cos(angle), side * np.sin(angle))[2])
    return np.asarray(np.where(least > 0, of_all, least))


def distortion_as_json(distortion: Distortion | None) -> dict[str, Any] | None:
    """Return a distortion as JSON-compatible values."""
    if distortion is None:
        return None
    made: dict[str, Any] = {
        "model": distortion.model.value,
        "coefficients": list(distortion.coefficients),
        "most_angle_deg": distortion.most_angle_deg,
    }
    if distortion.table is not None:
        table = distortion.table
        made["table"] = {
            "window": list(table.window),
            "shape": list(table.directions.shape),
            "directions": _packed(table.directions),
        }
        if table.places is not None:
            made["table"]["places"] = _packed(table.places)
    return made


def _packed(numbers: Floats) -> str:
    """Return numbers as float32, little-endian, through zlib, in base 64."""
    return b64encode(compress(np.ascontiguousarray(numbers, "<f4").tobytes())).decode()


def _unpacked(text: str, shape: Any) -> Floats:
    return np.frombuffer(decompress(b64decode(text)), "<f4").reshape(shape).astype(np.float32)


def distortion_of(values: Mapping[str, Any] | None) -> Distortion | None:
    """Return the distortion that distortion_as_json serialized; ValueError, KeyError or TypeError for anything else."""
    if values is None:
        return None
    model, table = DistortionModel(values["model"]), values.get("table")
    coefficients = tuple(float(k) for k in values["coefficients"])
    if len(coefficients) != COEFFICIENT_COUNTS[model] or (table is None) != (model not in WITH_TABLE):
        raise ValueError
    read = None
    if table is not None:
        left, right, bottom, top = map(float, table["window"])
        places = _unpacked(table["places"], table["shape"]) if model is DistortionModel.RAYS else None
        read = DirectionTable((left, right, bottom, top), _unpacked(table["directions"], table["shape"]), places)
    return Distortion(model, coefficients, float(values["most_angle_deg"]), read)
