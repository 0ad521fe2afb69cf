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


def lab_of(linear: npt.ArrayLike) -> Doubles:
    """CIELAB (..., 3) relative to D65 of linear Rec.709 (CIE 15:2004, 8.2.1)."""
    xyz = np.asarray(linear, np.float64) @ to_xyz(REC709).T / _xyz(*D65)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def hue_difference_deg(first: Doubles, second: Doubles) -> Doubles:
    """Unsigned difference of the CIELAB hue angles of two arrays (..., 3)."""
    angles = [np.degrees(np.arctan2(lab[..., 2], lab[..., 1])) for lab in (first, second)]
    return np.abs((angles[1] - angles[0] + 180) % 360 - 180)


def ciede2000(first: Doubles, second: Doubles) -> Doubles:
    """Colour difference of two CIELAB arrays (..., 3): Sharma, Wu and Dalal 2005, "The CIEDE2000 Color-Difference Formula"."""
    (l1, a1, b1), (l2, a2, b2) = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    c7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    g = 0.5 * (1 - np.sqrt(c7 / (c7 + 25.0**7)))
    a1, a2 = (1 + g) * a1, (1 + g) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360
    grey = c1 * c2 == 0
    dh = np.where(grey, 0.0, (h2 - h1 + 180) % 360 - 180)
    hue = np.where(grey, h1 + h2, h1 + dh / 2)
    lightness, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    t = 1 - 0.17 * _cos(hue - 30) + 0.24 * _cos(2 * hue) + 0.32 * _cos(3 * hue + 6) - 0.20 * _cos(4 * hue - 63)
    sl = 1 + 0.015 * (lightness - 50) ** 2 / np.sqrt(20 + (lightness - 50) ** 2)
    sc, sh = 1 + 0.045 * chroma, 1 + 0.015 * chroma * t
    rotation = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * _cos(90 - 60 * np.exp(-(((hue % 360 - 275) / 25) ** 2)))
    dl, dc, dh = (l2 - l1) / sl, (c2 - c1) / sc, 2 * np.sqrt(c1 * c2) * _cos(90 - dh / 2) / sh
    difference: Doubles = np.sqrt(dl * dl + dc * dc + dh * dh + rotation * dc * dh)
    return difference


def _cos(degrees: Doubles) -> Doubles:
    return np.cos(np.radians(degrees))
