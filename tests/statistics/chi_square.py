"""Pearson's chi-square test of sampled directions or points against their density. Its own test: test_chi_square.py.

Cells cover the sphere or the square; a density's probability in a cell comes from quadrature. What sampling drops (a
direction below the horizon, a delta lobe) is one more cell, with the probability that the density leaves over.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
MIN_EXPECTED = (
    5.0  # cells with fewer expected samples are pooled (Cochran 1954, "Some Methods for Strengthening the chi^2 Tests")
)
# Fractions of all samples: what may fall in a cell that quadrature missed, and how far its sum may be from certainty.
TRACE, QUADRATURE = 1e-4, 1e-3


def survival(statistic: float, degrees: int) -> float:
    """P(chi^2 > statistic): Wilson and Hilferty 1931, "The Distribution of Chi-Square"."""
    k = 2 / (9 * degrees)
    z = ((statistic / degrees) ** (1 / 3) - (1 - k)) / math.sqrt(k)
    return 0.5 * math.erfc(z / math.sqrt(2))


def p_value(observed: npt.ArrayLike, expected: npt.ArrayLike) -> float:
    """Of counts against expected counts, small cells pooled. 0 if more than a trace falls where nothing is expected."""
    o, e = np.asarray(observed, np.float64).ravel(), np.asarray(expected, np.float64).ravel()
    if o[e == 0].sum() > TRACE * o.sum():
        return 0.0
    o, e = o[e > 0], e[e > 0]
    order = np.argsort(e)
    o, e = o[order], e[order]
    small = int(np.searchsorted(e, MIN_EXPECTED))
    while 0 < small < len(e) and e[:small].sum() < MIN_EXPECTED:
        small += 1
    if small:
        o, e = np.append(o[small:], o[:small].sum()), np.append(e[small:], e[:small].sum())
    return survival(float(np.sum((o - e) ** 2 / e)), len(e) - 1) if len(e) > 1 else 1.0


@dataclass(frozen=True)
class SphereCells:
    """Rings and sectors about `axis`; rings grow with the power `growth` of their number, so that a peak there is resolved.

    `spread`: the largest angle from the axis; what lies beyond is part of the last cell.
    """

    axis: npt.ArrayLike
    growth: float = 1.0
    spread: float = math.pi
    rings: int = 24
    sectors: int = 16
    points: int = 12  # of quadrature along each side of a cell

    def frame(self) -> Doubles:
        """Rows: two tangents and the axis."""
        n = np.asarray(self.axis, np.float64)
        n = n / np.linalg.norm(n)
        t = np.cross(n, [1.0, 0, 0] if abs(n[0]) < 0.7 else [0, 1.0, 0])
        t /= np.linalg.norm(t)
        return np.stack([t, np.cross(n, t), n])

    def edges(self) -> Doubles:
        """1 - cos of the rings' angles, by 2 sin^2 so that small ones keep their digits."""
        return 2 * np.sin(0.5 * self.spread * (np.arange(self.rings + 1) / self.rings) ** self.growth) ** 2

    def integrate(self, density: Callable[[Doubles], npt.ArrayLike]) -> Doubles:
        """Probability of each cell, (rings, sectors)."""
        k = (np.arange(self.points) + 0.5) / self.points
        edges = self.edges()
        v = (edges[:-1, None] + np.diff(edges)[:, None] * k).ravel()
        phi = 2 * np.pi * (np.arange(self.sectors)[:, None] + k).ravel() / self.sectors
        w = self.directions(v[:, None], phi[None, :]).reshape(-1, 3)
        f = np.asarray(density(w), np.float64).reshape(self.rings, self.points, self.sectors, self.points)
        area = np.diff(edges) * (2 * np.pi / self.sectors)
        return f.mean(axis=(1, 3)) * area[:, None]

    def directions(self, v: Doubles, phi: Doubles) -> Doubles:
        s = np.sqrt(np.maximum(v * (2 - v), 0))
        local = np.stack(np.broadcast_arrays(s * np.cos(phi), s * np.sin(phi), 1 - v), axis=-1)
        return local @ self.frame()

    def count(self, w: npt.NDArray[np.floating], weights: Doubles | None = None) -> Doubles:
        """Directions in each cell, or the sum of their weights."""
        local = np.asarray(w, np.float64) @ self.frame().T
        sin2 = local[:, 0] ** 2 + local[:, 1] ** 2
        length = np.sqrt(sin2 + local[:, 2] ** 2)
        cos = local[:, 2] / length
        v = np.where(cos > 0, sin2 / length**2 / (1 + cos), 1 - cos)
        ring = np.searchsorted(self.edges(), v, side="right") - 1
        sector = np.floor((np.arctan2(local[:, 1], local[:, 0]) / (2 * np.pi) % 1.0) * self.sectors).astype(int) % self.sectors
        inside = ring < self.rings
        number, some = (ring * self.sectors + sector)[inside], None if weights is None else weights[inside]
        return (
            np.bincount(number, some, minlength=self.rings * self.sectors).astype(np.float64).reshape(self.rings, self.sectors)
        )


@dataclass(frozen=True)
class SquareCells:
    """A grid on a rectangle of the plane."""

    low: tuple[float, float] = (0.0, 0.0)
    high: tuple[float, float] = (1.0, 1.0)
    columns: int = 24
    rows: int = 24
    points: int = 12

    def integrate(self, density: Callable[[Doubles], npt.ArrayLike]) -> Doubles:
        nx, ny, k = self.columns, self.rows, self.points
        x = self.low[0] + (self.high[0] - self.low[0]) * (np.arange(nx * k) + 0.5) / (nx * k)
        y = self.low[1] + (self.high[1] - self.low[1]) * (np.arange(ny * k) + 0.5) / (ny * k)
        p = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        f = np.asarray(density(p), np.float64).reshape(nx, k, ny, k)
        return f.mean(axis=(1, 3)) * (self.high[0] - self.low[0]) * (self.high[1] - self.low[1]) / (nx * ny)

    def count(self, p: npt.NDArray[np.floating]) -> Doubles:
        sides = [(self.low[0], self.high[0]), (self.low[1], self.high[1])]
        return np.histogram2d(p[:, 0], p[:, 1], bins=[self.columns, self.rows], range=sides)[0]


def density_p_value(
    cells: SphereCells | SquareCells, density: Callable[[Doubles], npt.ArrayLike], samples: npt.NDArray[np.floating], total: int
) -> float:
    """The p-value of `samples`, out of `total` draws of which the rest was dropped, having this density."""
    return count_p_value(cells.integrate(density), cells.count(samples), total)


def count_p_value(probability: Doubles, observed: Doubles, total: int) -> float:
    """The p-value of counts in cells of these probabilities, the rest of `total` draws having been dropped."""
    expected = probability * total
    left, dropped = total - float(expected.sum()), total - float(observed.sum())
    slack = QUADRATURE * total
    if left < -slack:
        return 0.0
    if left < slack:
        # A certainty but for quadrature.
        return p_value(observed, expected * (observed.sum() / expected.sum())) if dropped <= 2 * slack else 0.0
    return p_value(np.append(observed, dropped), np.append(expected, left))
