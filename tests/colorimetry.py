"""Conversions between RGB spaces from published chromaticities, in double, for tests: a way of its own beside color_space.py.

RGB to XYZ by scaling the primaries so that they add up to white; whites meet by the Bradford transform (Lam 1985).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]

D50 = (0.3457, 0.3585)
D65 = (0.3127, 0.3290)  # as ITU-R BT.709 rounds it
ACES_WHITE = (0.32168, 0.33767)  # SMPTE ST 2065-1
REC709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), D65)
REC2020 = ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), D65)
P3_D65 = ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), D65)
AP1 = ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), ACES_WHITE)  # S-2014-004
AP0 = ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770), ACES_WHITE)

_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])

Gamut = tuple[tuple[float, float], ...]


def _xyz(x: float, y: float) -> Doubles:
    return np.array([x / y, 1.0, (1 - x - y) / y])


def to_xyz(gamut: Gamut) -> Doubles:
    columns = np.array([[x, y, 1 - x - y] for x, y in gamut[:3]]).T
    return columns @ np.diag(np.linalg.inv(columns) @ _xyz(*gamut[3]))


def adaptation(source: tuple[float, float], target: tuple[float, float]) -> Doubles:
    cones = (_BRADFORD @ _xyz(*target)) / (_BRADFORD @ _xyz(*source))
    return np.linalg.inv(_BRADFORD) @ np.diag(cones) @ _BRADFORD


def between(source: Gamut, target: Gamut, *, adapt: bool = True) -> Doubles:
    cat = adaptation(source[3], target[3]) if adapt and source[3] != target[3] else np.eye(3)
    return np.linalg.inv(to_xyz(target)) @ cat @ to_xyz(source)


def from_srgb(v: npt.ArrayLike) -> Doubles:
    """IEC 61966-2-1."""
    v = np.asarray(v, np.float64)
    return np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0) + 0.055) / 1.055) ** 2.4)
