"""IES LM-63 files for the referee: a table of candela over two angles, read bilinearly. Only what its tests write: no TILT.

Horizontal angle 0 of type C lies at -X of the light and turns counterclockwise seen from its back (+Z): UsdLux does not say,
this is where OpenUSD's hdEmbree has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Photometry:
    """Type C: `vertical` from the light's axis (-Z), `horizontal` about it, radians, unfolded to a full turn."""

    vertical: Doubles
    horizontal: Doubles
    candela: Doubles  # (H, V)
    power: float

    def candela_at(self, theta: Doubles, direction: Doubles) -> Doubles:
        """Zero outside of the table's vertical angles."""
        phi = np.mod(np.arctan2(-direction[..., 1], -direction[..., 0]), 2 * np.pi)
        j, f = _between(self.vertical, theta)
        i, g = _between(self.horizontal, phi) if self.horizontal.size > 1 else (np.zeros(phi.shape, int), np.zeros(phi.shape))
        up = np.minimum(i + 1, self.horizontal.size - 1)
        c = self.candela
        value = (c[i, j] * (1 - f) + c[i, j + 1] * f) * (1 - g) + (c[up, j] * (1 - f) + c[up, j + 1] * f) * g
        return np.where((theta >= self.vertical[0]) & (theta <= self.vertical[-1]), value, 0.0)


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
    assert kind == 1, "the referee reads type C"
    horizontal, candela = _full_turn(horizontal, candela)
    return Photometry(vertical, horizontal, candela, _mean_power(vertical, horizontal, candela))


def _full_turn(h: Doubles, c: Doubles) -> tuple[Doubles, Doubles]:
    """LM-63: a table that ends at 0, 90 or 180 degrees stands for all round, two or four mirrored quadrants."""
    for end in (np.pi / 2, np.pi):
        if h.size > 1 and np.isclose(h[-1], end) and np.isclose(h[0], 0):
            h, c = np.concatenate([h, 2 * end - h[-2::-1]]), np.concatenate([c, c[-2::-1]])
    return h, c


def _mean_power(v: Doubles, h: Doubles, c: Doubles) -> float:
    """Over the patches of the table, each with the mean of its corners, by 4 pi: reading 2 of the project's notes."""
    turn = np.array([2 * np.pi]) if h.size == 1 else np.diff(h)
    rows = c if h.size == 1 else (c[1:] + c[:-1]) / 2
    means = (rows[:, 1:] + rows[:, :-1]) / 2
    solid = np.outer(turn, np.cos(v[:-1]) - np.cos(v[1:]))
    whole = 4 * np.pi if v[-1] > np.pi / 2 + 1e-6 and v[0] < np.pi / 2 - 1e-6 else 2 * np.pi
    return float((means * solid).sum() / whole)
