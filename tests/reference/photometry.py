"""IES LM-63 files for the referee: tables of candela over two angles, read bilinearly. Only what its tests write: no TILT.

LM-63-2002, section 3, says where angles lie about a luminaire; UsdLux, that its nadir is -Z of the light, but not where
horizontal angle 0 is: as in OpenUSD's hdEmbree, at -X, seen from above (+Z) counterclockwise in type C, clockwise in A, B.
In a profile's own frame z is up and x at horizontal angle 0, so that a light's direction (x, y, z) is (-x, -y, z).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Photometry:
    kind: str  # A, B, C
    vertical: Doubles  # radians: from -Z in type C, from the horizontal in A, in B about the horizontal axis y, from -Z to x
    horizontal: Doubles  # a full turn in C (or one value); in B the lean out of its planes
    candela: Doubles  # (H, V)
    power: float

    def candela_at(self, d: Doubles, scale: float) -> Doubles:
        """For unit directions in the light's space (..., 3), angles off -Z scaled as inputs:shaping:ies:angleScale has it."""
        x, y, z = -d[..., 0], -d[..., 1], d[..., 2]
        across = np.hypot(x, y)
        theta = np.minimum(_scaled(np.arctan2(across, -z), scale), np.pi)
        phi = np.arctan2(y, x)
        if self.kind == "B":
            assert scale == 0, "the referee scales no type B"
            v, h = np.arctan2(x, -z), np.arctan2(-y, np.hypot(x, z))
        elif self.kind == "A":
            v, h = theta - np.pi / 2, -phi
        else:
            v, h = theta, np.mod(phi, TURN)
        return self._read(v, h)

    def _read(self, v: Doubles, h: Doubles) -> Doubles:
        """Zero outside of the table."""
        j, f = _between(self.vertical, v)
        inside = (v >= self.vertical[0]) & (v <= self.vertical[-1])
        if self.horizontal.size == 1:
            row = self.candela[0]
            return np.where(inside, row[j] * (1 - f) + row[j + 1] * f, 0.0)
        i, g = _between(self.horizontal, h)
        inside &= (h >= self.horizontal[0]) & (h <= self.horizontal[-1])
        c = self.candela
        value = (c[i, j] * (1 - f) + c[i, j + 1] * f) * (1 - g) + (c[i + 1, j] * (1 - f) + c[i + 1, j + 1] * f) * g
        return np.where(inside, value, 0.0)

    def cones(self, scale: float) -> list[tuple[Doubles, float]]:
        """Axis in the light's space and angle from it, where the table has a row."""
        if self.kind == "B":
            return [(np.array([0, 1.0, 0]), float(a)) for a in self.horizontal + np.pi / 2 if 0 < a < np.pi]
        v = self.vertical + (np.pi / 2 if self.kind == "A" else 0)
        light = v if scale == 0 else v * scale if scale > 0 else (v - np.pi) * -scale + np.pi
        return [(np.array([0, 0, -1.0]), float(a)) for a in light if 0 < a < np.pi]

    def planes(self) -> list[Doubles]:
        """Normals in the light's space of planes where the table has a column."""
        if self.kind == "B":
            return [np.array([np.cos(a), 0, -np.sin(a)]) for a in self.vertical]
        return [np.array([-np.sin(a), np.cos(a), 0]) for a in (-1 if self.kind == "A" else 1) * self.horizontal]


def _scaled(theta: Doubles, scale: float) -> Doubles:
    if scale > 0:
        return theta / scale
    return theta if scale == 0 else (theta - np.pi) / -scale + np.pi


def _between(grid: Doubles, x: Doubles) -> tuple[npt.NDArray[np.int64], Doubles]:
    i = np.clip(np.searchsorted(grid, x, side="right") - 1, 0, grid.size - 2)
    return i, np.clip((x - grid[i]) / (grid[i + 1] - grid[i]), 0, 1)


def read_photometry(path: str) -> Photometry:
    text = Path(path).read_text(encoding="ascii")
    numbers = [float(x) for x in text[text.index("TILT=NONE") + len("TILT=NONE") :].replace(",", " ").split()]
    _, _, multiplier, nv, nh, kind = numbers[:6]
    ballast = numbers[10]
    rest = numbers[13:]
    v, h = int(nv), int(nh)
    vertical, horizontal = np.radians(rest[:v]), np.radians(rest[v : v + h])
    candela = np.array(rest[v + h : v + h + v * h]).reshape(h, v) * multiplier * ballast
    letter = "CBA"[int(kind) - 1]
    if letter == "C":
        horizontal, candela = _full_turn(horizontal, candela)
    power = _mean_power(vertical, horizontal, candela) if letter == "C" else np.nan
    return Photometry(letter, vertical, horizontal, candela, power)


def _full_turn(h: Doubles, c: Doubles) -> tuple[Doubles, Doubles]:
    """A table that ends at 0, 90 or 180 degrees stands for all round, four or two mirrored parts; from 90 to 270, for two."""
    if h.size > 1 and np.isclose(h[0], np.pi / 2) and np.isclose(h[-1], 3 * np.pi / 2):
        h, c = np.concatenate([h, 3 * np.pi - h[-2::-1]]), np.concatenate([c, c[-2::-1]])
        turned = np.mod(h[:-1], TURN)
        order = np.argsort(turned)
        h, c = turned[order], c[:-1][order]
        assert np.isclose(h[0], 0), "the referee's files have a plane at 180"
        return np.append(h, TURN), np.concatenate([c, c[:1]])
    for end in (np.pi / 2, np.pi):
        if h.size > 1 and np.isclose(h[-1], end) and np.isclose(h[0], 0):
            h, c = np.concatenate([h, 2 * end - h[-2::-1]]), np.concatenate([c, c[-2::-1]])
    return h, c


def _mean_power(v: Doubles, h: Doubles, c: Doubles) -> float:
    """Over the patches of the table, each with the mean of its corners, by 4 pi or, for a hemisphere, 2 pi (reading 2)."""
    turn = np.array([TURN]) if h.size == 1 else np.diff(h)
    rows = c if h.size == 1 else (c[1:] + c[:-1]) / 2
    means = (rows[:, 1:] + rows[:, :-1]) / 2
    solid = np.outer(turn, np.cos(v[:-1]) - np.cos(v[1:]))
    whole = 4 * np.pi if v[-1] > np.pi / 2 + 1e-6 and v[0] < np.pi / 2 - 1e-6 else TURN
    return float((means * solid).sum() / whole)
