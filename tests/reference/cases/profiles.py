"""Photometric files that tests write: LM-63-2002."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def profile(vertical: npt.ArrayLike, horizontal: npt.ArrayLike, candela: npt.ArrayLike, kind: int = 1) -> str:
    """Degrees, and (H, V) candela; multiplier 2, ballast factor 0.5."""
    v, h, c = np.asarray(vertical, float), np.asarray(horizontal, float), np.asarray(candela, float)

    def row(values: npt.NDArray[np.float64]) -> str:
        return "\n".join(" ".join(f"{x:.6g}" for x in values[i : i + 8]) for i in range(0, values.size, 8))

    rows = "\n".join(row(r) for r in c)
    head = f"IESNA:LM-63-2002\n[TEST] made up\nTILT=NONE\n1 -1 2 {v.size} {h.size} {kind} 2 0 0 0\n0.5 1 100"
    return f"{head}\n{row(v)}\n{row(h)}\n{rows}\n"


def uneven_profile() -> str:
    """All around and unlike in every direction; few angles, at odd places."""
    v, h = [0, 15, 40, 75, 90, 130, 180], [0, 50, 110, 200, 300, 360]
    c = 0.2 + np.random.default_rng(3).random((len(h), len(v))) * 1.5
    c[:, 0], c[:, -1], c[-1] = 1.4, 0.3, c[0]
    return profile(v, h, c)


def spot_profile() -> str:
    """Round, to 60 degrees, at every 2.5."""
    v = np.arange(0, 60.1, 2.5)
    return profile(v, [0], [np.cos(np.radians(v * 1.5)) ** 2 * 5])


def quadrant_profile() -> str:
    v, h = np.arange(0, 90.1, 10), [0, 30, 90]
    return profile(v, h, [np.cos(np.radians(v)) * k + 0.1 for k in (1, 2, 4)])


def half_profile() -> str:
    v, h = np.arange(0, 180.1, 30), [0, 60, 180]
    return profile(v, h, [1 + k * np.cos(np.radians(v)) ** 2 for k in (0.2, 1, 3)])


def fine_profile() -> str:
    """For normalize: steps so small that a patch's solid angle is its sine times its size."""
    v, h = np.arange(0, 180.1, 2), np.arange(0, 360.1, 15)
    c = np.array([1 + np.cos(np.radians(v)) ** 2 * (2 + np.cos(np.radians(p))) for p in h]) * 20
    c[:, 0], c[:, -1] = c[:, 0].mean(), c[:, -1].mean()
    return profile(v, h, c)


def ninety_profile() -> str:
    """LM-63-1995: planes from 90 to 270, the other half their mirror image about the plane of both."""
    v, h = np.arange(0, 180.1, 30), [90, 130, 180, 270]
    return profile(v, h, [1 + k * np.cos(np.radians(v)) ** 2 for k in (0.2, 1, 3, 0.5)])


def type_a_profile() -> str:
    v, h = np.arange(-90, 90.1, 30), [-90, -40, 0, 60, 90]
    return profile(v, h, 0.1 + np.random.default_rng(5).random((len(h), len(v))), kind=3)


def type_b_profile() -> str:
    v, h = np.arange(-90, 90.1, 30), [-90, -40, 0, 60, 90]
    return profile(v, h, 0.1 + np.random.default_rng(6).random((len(h), len(v))), kind=2)
