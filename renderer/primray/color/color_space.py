"""RGB colour spaces by their primaries, white point and transfer curve, and the conversion between any two, in double.

The named ones are GfColorSpaceNames, the interop ids that USD, MaterialX and OpenColorIO share. Conversions are
GfColorSpace's: through CIE XYZ without chromatic adaptation; the ACES primaries are already adapted to D65 (Bradford), as in
OpenColorIO's built-in configs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats

Chromaticity = tuple[float, float]


@dataclass(frozen=True)
class ColorSpace:
    """Chromaticities x, y; the curve to linear is ((v + bias) / (1 + bias)) ^ gamma above its straight part."""

    name: str
    red: Chromaticity
    green: Chromaticity
    blue: Chromaticity
    white: Chromaticity
    gamma: float = 1.0
    bias: float = 0.0
    is_data: bool = False  # data, not colours: never converted

    @property
    def is_linear(self) -> bool:
        return self.gamma == 1.0

    @property
    def gamut(self) -> tuple[Chromaticity, Chromaticity, Chromaticity, Chromaticity]:
        return self.red, self.green, self.blue, self.white


_D65, _E = (0.3127, 0.3290), (1 / 3, 1 / 3)
_XYZ = ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), _E)  # RGB equals XYZ
_REC709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), _D65)
_ADOBE = ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), _D65)
_P3 = ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06), _D65)
_REC2020 = ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), _D65)
# GfColorSpace's own: AP1 and AP0 adapted from their white (0.32168, 0.33767) to D65.
_AP1 = ((0.713195860, 0.292688906), (0.159508556, 0.838788509), (0.128673002, 0.043895572), _D65)
_AP0 = ((0.734855235, 0.264225334), (-0.006170913, 1.011314988), (0.015967559, -0.064235501), _D65)
_SRGB = (2.4, 0.055)

LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)  # of linear Rec.709: Rec. ITU-R BT.709-6, 3.2

REC709 = ColorSpace("lin_rec709_scene", *_REC709)  # USD's default (ColorSpaceAPI)
SRGB = ColorSpace("srgb_rec709_scene", *_REC709, *_SRGB)
ACESCG = ColorSpace("lin_ap1_scene", *_AP1)

_NAMED = (
    REC709,
    SRGB,
    ACESCG,
    ColorSpace("lin_ap0_scene", *_AP0),
    ColorSpace("lin_p3d65_scene", *_P3),
    ColorSpace("lin_rec2020_scene", *_REC2020),
    ColorSpace("lin_adobergb_scene", *_ADOBE),
    ColorSpace("lin_ciexyzd65_scene", *_XYZ),
    ColorSpace("g18_rec709_scene", *_REC709, 1.8),
    ColorSpace("g22_rec709_scene", *_REC709, 2.2),
    ColorSpace("g24_rec709_scene", *_REC709, 2.4),
    ColorSpace("g22_adobergb_scene", *_ADOBE, 563 / 256),
    ColorSpace("g22_ap1_scene", *_AP1, 2.2),
    ColorSpace("srgb_ap1_scene", *_AP1, *_SRGB),
    ColorSpace("srgb_p3d65_scene", *_P3, *_SRGB),
    *(ColorSpace(name, *_XYZ, is_data=True) for name in ("data", "raw", "unknown", "identity")),
)
_BY_NAME = {space.name: space for space in _NAMED}
# UsdUVTexture's token, names in earlier releases of USD, and MaterialX's names ("Color Spaces and
# Color Management Systems" of its specification, with the curves of its library cmlib).
_OTHER_NAMES = {
    "sRGB": SRGB,
    "srgb_texture": SRGB,
    "lin_srgb": REC709,
    "lin_displayp3_scene": _BY_NAME["lin_p3d65_scene"],
    "lin_displayp3": _BY_NAME["lin_p3d65_scene"],
    "srgb_displayp3": _BY_NAME["srgb_p3d65_scene"],
    "adobergb": _BY_NAME["g22_adobergb_scene"],
    "rec709_display": _BY_NAME["g24_rec709_scene"],
    "acescg": ACESCG,
    "g18_ap1": ColorSpace("g18_ap1", *_AP1, 1.8),
}


def named(name: str) -> ColorSpace | None:
    """Return a space by its interop id, with or without "_scene", or by another of its names; None if unknown."""
    return _BY_NAME.get(name) or _BY_NAME.get(f"{name}_scene") or _OTHER_NAMES.get(name)


def linear_spaces() -> list[ColorSpace]:
    """Return the named linear spaces that images can be in."""
    return [space for space in _NAMED if space.is_linear and not space.is_data]


@lru_cache(maxsize=256)
def xyz_from_rgb(gamut: tuple[Chromaticity, ...]) -> Doubles:
    """Return the matrix from linear RGB to XYZ, with Y = 1 for white.

    SMPTE RP 177-1993, "Derivation of Basic Television Color Equations", 3.3.
    """
    xyz = np.array([[x, y, 1.0 - x - y] for x, y in gamut[:3]]).T
    white_x, white_y = gamut[3]
    white = np.array([white_x / white_y, 1.0, (1.0 - white_x - white_y) / white_y])
    matrix: Doubles = xyz * np.linalg.solve(xyz, white)
    matrix.flags.writeable = False
    return matrix


def luminance_weights(space: ColorSpace) -> tuple[float, float, float]:
    """Return the weights of a space's linear values in the CIE's Y, which is 1 for white."""
    if space.gamut == _REC709:
        return LUMINANCE_WEIGHTS
    r, g, b = xyz_from_rgb(space.gamut)[1].tolist()
    return (r, g, b)


def is_gamut(space: ColorSpace) -> bool:
    """Return whether the space has a matrix: its primaries are not collinear, and its white has light."""
    numbers = np.array(space.gamut, np.float64)
    if not np.isfinite(numbers).all() or space.white[1] == 0:
        return False
    xyz = np.concatenate([numbers[:3], 1.0 - numbers[:3].sum(axis=1, keepdims=True)], axis=1)
    return bool(abs(np.linalg.det(xyz)) > 1e-9)


@lru_cache(maxsize=256)
def matrix(source: ColorSpace, target: ColorSpace) -> Doubles | None:
    """Return the matrix from linear values of one space to those of another; None where they are the same."""
    if source.is_data or target.is_data or source.gamut == target.gamut:
        return None
    made: Doubles = np.asarray(np.linalg.solve(xyz_from_rgb(target.gamut), xyz_from_rgb(source.gamut)), np.float64)
    if source.white == target.white:  # greys are unchanged to the last bit of a float
        made /= made.sum(axis=1, keepdims=True)
    made.flags.writeable = False
    return made


def linear(values: npt.NDArray[np.floating], space: ColorSpace) -> Doubles:
    """Return values with the transfer curve undone; below its straight part, and for powers below 0, it is linear."""
    v = np.asarray(values, np.float64)
    if space.is_linear:
        return v
    if (space.gamma, space.bias) == _SRGB:  # IEC 61966-2-1, whose constants are rounded; they differ by 2.5e-4 at most
        start, slope = 0.04045, 12.92
    elif space.bias > 0:  # GfColorSpace: the straight part is tangent to the curve
        start = space.bias / (space.gamma - 1)
        slope = start / ((start + space.bias) / (1 + space.bias)) ** space.gamma
    else:
        start, slope = 0.0, 1.0
    curved = ((np.maximum(v, start) + space.bias) / (1 + space.bias)) ** space.gamma
    return np.where(v <= start, v / slope, curved)


def transformed(values: npt.NDArray[np.floating], by: Doubles | None) -> Floats:
    """Return (..., 3) linear values times a matrix, as floats."""
    if by is None:
        return np.asarray(values, np.float32)
    made: Floats = (np.asarray(values, np.float64) @ by.T).astype(np.float32)
    return made


def converted(values: npt.NDArray[np.floating], source: ColorSpace, target: ColorSpace) -> Doubles:
    """Return (..., 3) values of one space in a linear one; data, which are no colours, are unchanged."""
    if source.is_data:
        return np.asarray(values, np.float64)
    by = matrix(source, target)
    straight = linear(values, source)
    made: Doubles = straight if by is None else straight @ by.T
    return made
