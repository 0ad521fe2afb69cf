"""Lens distortion by the OmniLensDistortion* schemas of NVIDIA's Omniverse; USD need not know the schemas.

Names and defaults are those of the ovrtx 0.7 documentation ("Lens Distortion Schemas"), which gives no formulas. Film
points are in pixels of the calibrated sensor from its upper left corner, (0.5, 0.5) being the first pixel's centre.
OmniLensDistortionLutAPI's table is an image of directions (X, Y, Z in camera space) over the calibrated sensor.
docs/decisions/images/lens-distortion.md has the choices that the schemas leave open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd

from ...description import TextureFile
from ...diagnostics import Diagnostics
from ...errors import PrimrayError
from ...lens.distortion import DirectionTable, Distortion, DistortionModel
from ...textures.texture import load_texture
from ..scene.schemas import applied_schemas
from ..stage.reads import property_names, read_asset
from ..stage.values import When, number, read, token, vector

DISTORTION_PREFIX = "omni:lensdistortion:"
MODEL = f"{DISTORTION_PREFIX}model"
# Models by the name of the schema.
SCHEMAS = {
    "OmniLensDistortionFthetaAPI": "ftheta",
    "OmniLensDistortionKannalaBrandtK3API": "kannalaBrandtK3",
    "OmniLensDistortionRadTanThinPrismAPI": "radTanThinPrism",
    "OmniLensDistortionLutAPI": "lut",
    "OmniLensDistortionOpenCvFisheyeAPI": "opencvFisheye",
    "OmniLensDistortionOpenCvPinholeAPI": "opencvPinhole",
}
NO_MODEL = ("", "none", "pinhole")
# Older Omniverse cameras have these attributes without a schema; their polynomial is ftheta's, with its defaults.
PROJECTION = "cameraProjectionType"
POLYNOMIAL = "fisheyePolynomial"
SPHERICAL = "fisheyeSpherical"
STEREO = "omniDirectionalStereo"
_OLD_KANNALA_BRANDT, _OLD_THIN_PRISM = "fisheyeKannalaBrandtK3", "fisheyeRadTanThinPrism"
# sin x for x up to a right angle, by odd powers; to 6e-9.
SINE = (0.9999999804869029, -0.16666646567229063, 0.008332859672361128, -0.0001979788797810233, 2.5840157831988485e-06)
# Radius on the film by the angle to the axis, in focal lengths, and the largest angle in degrees: sin a, a, 2 sin(a / 2).
_BY_ANGLE = {
    "fisheyeOrthographic": (SINE, 90.0),
    "fisheyeEquidistant": ((1.0, 0.0, 0.0, 0.0, 0.0), 180.0),
    "fisheyeEquisolid": (tuple(c / 4**power for power, c in enumerate(SINE)), 180.0),
}
OLDER = (POLYNOMIAL, SPHERICAL, STEREO, _OLD_KANNALA_BRANDT, _OLD_THIN_PRISM, *_BY_ANGLE)
EYE_DISTANCE, IS_LEFT_EYE = "interpupillaryDistance", "isLeftEye"
EYES_APART = 6.4  # the default, in centimetres
_OF_POLYNOMIAL = {
    "nominalWidth": "fthetaWidth",
    "nominalHeight": "fthetaHeight",
    "maxFov": "fthetaMaxFov",
    **{f"k{power}": f"fthetaPoly{letter}" for power, letter in enumerate("ABCDE")},
}
FIFTH_POWER = "fthetaPolyF"  # coefficient of the fifth power, which ftheta does not have


@dataclass(frozen=True)
class Sensor:
    """A calibrated sensor, in pixels, and its lens distortion."""

    width: float
    height: float
    center: tuple[float, float]  # the optical axis, from the upper left corner
    focal: tuple[float, float]  # pixels per unit of film, x and y
    distortion: Distortion
    fills_frame: bool = False  # whatever the picture's aspect ratio is


class _UnusableDistortion(Exception):
    """Distortion attributes that cannot be used; the message says why, `name` is the attribute's."""

    def __init__(self, sentence: str, name: str) -> None:
        super().__init__(sentence)
        self.name = name


@dataclass(frozen=True)
class _Attributes:
    """Reader for the attributes of one distortion model."""

    prim: Usd.Prim
    model: str
    when: When
    diagnostics: Diagnostics

    def name(self, short: str) -> str:
        return f"{DISTORTION_PREFIX}{self.model}:{short}"

    def number(self, short: str, default: float = 0.0) -> float:
        return number(self.prim, self.name(short), self.when, default, self.diagnostics)

    def numbers(self, shorts: str, **defaults: float) -> tuple[float, ...]:
        return tuple(self.number(short, defaults.get(short, 0.0)) for short in shorts.split())

    def pair(self, short: str, default: tuple[float, float]) -> tuple[float, float]:
        raw = read(self.prim, self.name(short), self.when)
        if type(raw).__name__ == "Vec2i":
            return float(raw[0]), float(raw[1])
        x, y = vector(self.prim, self.name(short), self.when, default, self.diagnostics)
        return x, y

    def above_0(self, short: str, default: float) -> float:
        found = self.number(short, default)
        if not found > 0:
            raise _UnusableDistortion(f"{self.name(short)} = {found:g} is not above 0", self.name(short))
        return found

    def nominal(self) -> tuple[float, float, tuple[float, float]]:
        """Return width, height and optical centre in pixels."""
        width, height = self.above_0("nominalWidth", 1936.0), self.above_0("nominalHeight", 1216.0)
        center = (970.9424, 600.3748) if (width, height) == (1936.0, 1216.0) else (width / 2, height / 2)
        return width, height, self.pair("opticalCenter", center)

    def image(self) -> tuple[float, float, tuple[float, float], tuple[float, float]]:
        """Return width, height, optical centre and focal lengths in pixels of OpenCV's models."""
        width, height = self.pair("imageSize", (2048.0, 1024.0))
        if not min(width, height) > 0:
            name = self.name("imageSize")
            raise _UnusableDistortion(f"{name} = ({width:g}, {height:g}) is not a size", name)
        focal = self.above_0("fx", 900.0), self.above_0("fy", 800.0)
        return width, height, (self.number("cx", 1024.0), self.number("cy", 512.0)), focal

    def half_fov(self, default: float) -> float:
        """Return half of the maximum field of view in degrees, at most 180."""
        return min(self.above_0("maxFov", default) / 2, 180.0)


class _OlderAttributes(_Attributes):
    """Reader for the attributes of a camera with a cameraProjectionType."""

    def name(self, short: str) -> str:
        return _OF_POLYNOMIAL.get(short, short)

    def pair(self, short: str, default: tuple[float, float]) -> tuple[float, float]:
        x, y = (
            number(self.prim, f"ftheta{c}", self.when, at, self.diagnostics)
            for c, at in zip(("Cx", "Cy"), default, strict=True)
        )
        return x, y


def _older_projection(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> str:
    """Return the name of a lens, "" for a pinhole; report a projection of another name, which is rendered as a pinhole."""
    if PROJECTION not in property_names(prim):
        return ""
    named = token(prim, PROJECTION, when, "")
    if named in NO_MODEL or named in OLDER:
        return named if named in OLDER else ""
    message = (
        f"{PROJECTION} = {named} is not supported: it is rendered as a pinhole. Author one of the OmniLensDistortion schemas "
        "(docs/lens.md), which say what the lens does."
    )
    diagnostics.add("camera-input", str(prim.GetPath()), message, PROJECTION)
    return ""


def distortion_model(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> str:
    """Return the model that the camera names or whose schema is applied, "" for none; report an unknown one."""
    named = token(prim, MODEL, when, "")
    if named not in NO_MODEL:
        if named in SCHEMAS.values():
            return named
        message = f"{MODEL} = {named} is not supported: lens distortion is ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, MODEL)
        return ""
    if named or MODEL in property_names(prim):
        return ""
    applied = next((SCHEMAS[schema] for schema in applied_schemas(prim) if schema in SCHEMAS), "")
    return applied or _older_projection(prim, when, diagnostics)


def read_sensor(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> Sensor | None:
    """Return the calibrated sensor; None without lens distortion or, with a diagnostic, if it cannot be used."""
    model = distortion_model(prim, when, diagnostics)
    if not model:
        return None
    try:
        if model in OLDER:
            return _older(_OlderAttributes(prim, model, when, diagnostics))
        return _READERS[model](_Attributes(prim, model, when, diagnostics))
    except _UnusableDistortion as why:
        message = f"{why}: lens distortion is ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, why.name)
        return None


def report_ignored_distortion(prim: Usd.Prim, when: When, diagnostics: Diagnostics) -> None:
    """Report the lens distortion of an orthographic camera, which has no lens."""
    if distortion_model(prim, when, diagnostics):
        message = "An orthographic camera has no lens: its distortion is ignored."
        diagnostics.add("camera-input", str(prim.GetPath()), message, MODEL)


def _ftheta(a: _Attributes) -> Sensor:
    """Return ftheta's sensor: k0 to k4 give the angle in radians by the distance in pixels; 1 / k1 is the focal length."""
    width, height, center = a.nominal()
    k = a.numbers("k0 k1 k2 k3 k4", k1=0.00245)
    focal = 1 / k[1] if k[1] > 0 else max(width, height) / 2
    scaled = tuple(c * focal**power for power, c in enumerate(k))
    if not (k[1] >= 0 and any(c > 0 for c in k[1:]) and all(map(math.isfinite, scaled))):
        raise _UnusableDistortion("the polynomial k0 to k4 has no angle that grows with the distance", a.name("k1"))
    return Sensor(width, height, center, (focal, focal), Distortion(DistortionModel.RADIUS_TO_ANGLE, scaled, a.half_fov(200.0)))


def _older(a: _OlderAttributes) -> Sensor:
    """Return the sensor of a lens that cameraProjectionType names."""
    if a.model == POLYNOMIAL:
        return _polynomial(a)
    if a.model in (SPHERICAL, STEREO):
        return _all_around(a)
    width, height, center = a.nominal()
    if a.model in _BY_ANGLE:
        # The circle of the largest angle touches the nominal picture's left and right.
        k, widest = _BY_ANGLE[a.model]
        half = min(a.half_fov(200.0), widest)
        lens = Distortion(DistortionModel.ANGLE_TO_RADIUS, k, half)
        focal = width / 2 / float(np.hypot(*lens.project([[np.sin(np.radians(half)), 0.0, -np.cos(np.radians(half))]])[0]))
        return Sensor(width, height, center, (focal, focal), lens)
    k = a.numbers(" ".join(f"fthetaPoly{letter}" for letter in "ABCDEF"))
    focal_lengths = a.above_0("openCVFx", 900.0), a.above_0("openCVFy", 800.0)
    if a.model == _OLD_KANNALA_BRANDT:
        lens = Distortion(DistortionModel.ANGLE_TO_RADIUS, (1.0, *k[:4]), a.half_fov(200.0))
        return Sensor(width, height, center, focal_lengths, lens)
    p0, p1, s0, s1, s2, s3 = a.numbers("p0 p1 s0 s1 s2 s3")
    rational = (k[0], k[1], p0, p1, *k[2:], s0, s1, s2, s3)
    lens = Distortion(DistortionModel.RATIONAL, rational, min(a.half_fov(180.0), 90.0))
    return Sensor(width, height, center, focal_lengths, lens)


def _all_around(a: _OlderAttributes) -> Sensor:
    """Return an equirectangular picture of the whole frame, of one eye of two for omniDirectionalStereo."""
    eyes = 0.0
    if a.model == STEREO:
        eyes = max(number(a.prim, EYE_DISTANCE, a.when, EYES_APART, a.diagnostics), 0.0)
    side = -1.0 if read(a.prim, IS_LEFT_EYE, a.when) else 1.0
    lens = Distortion(DistortionModel.LAT_LONG, (eyes, 2.0, side) if eyes else (0.0, 0.0, 0.0))
    width, height = 2 * math.pi, math.pi
    return Sensor(width, height, (width / 2, height / 2), (1.0, 1.0), lens, fills_frame=True)


def _polynomial(a: _OlderAttributes) -> Sensor:
    sixth = number(a.prim, FIFTH_POWER, a.when, 0.0, a.diagnostics)
    if sixth != 0:
        a.diagnostics.add(
            "camera-input", str(a.prim.GetPath()), f"{FIFTH_POWER} = {sixth:g} is left out of the polynomial.", FIFTH_POWER
        )
    return _ftheta(a)


def _kannala_brandt(a: _Attributes) -> Sensor:
    """Return Kannala and Brandt's sensor: k0 to k3 give the distance in pixels by odd powers of the angle (2006, eq. 6)."""
    width, height, center = a.nominal()
    k = a.numbers("k0 k1 k2 k3")
    if not k[0] > 0:
        raise _UnusableDistortion(f"{a.name('k0')} = {k[0]:g}, pixels by radian at the axis, is not above 0", a.name("k0"))
    scaled = (*(c / k[0] for c in k), 0.0)
    return Sensor(width, height, center, (k[0], k[0]), Distortion(DistortionModel.ANGLE_TO_RADIUS, scaled, a.half_fov(200.0)))


def _opencv_fisheye(a: _Attributes) -> Sensor:
    width, height, center, focal = a.image()
    k = (1.0, *a.numbers("k1 k2 k3 k4", k1=0.00245))
    return Sensor(width, height, center, focal, Distortion(DistortionModel.ANGLE_TO_RADIUS, k))


def _opencv_pinhole(a: _Attributes) -> Sensor:
    width, height, center, focal = a.image()
    k = a.numbers("k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4")
    return Sensor(width, height, center, focal, Distortion(DistortionModel.RATIONAL, k, 90.0))


def _rad_tan_thin_prism(a: _Attributes) -> Sensor:
    """Return OpenCV's rational model by other names; it has no focal length, so the camera's is used."""
    width, height, center = a.nominal()
    k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3 = a.numbers("k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3")
    length = number(a.prim, "focalLength", a.when, 50.0, a.diagnostics)
    aperture = number(a.prim, "horizontalAperture", a.when, 20.955, a.diagnostics)
    if not min(length, aperture) > 0:
        raise _UnusableDistortion("focalLength and horizontalAperture must be above 0", "focalLength")
    focal = width * length / aperture
    k = (k0, k1, p0, p1, k2, k3, k4, k5, s0, s1, s2, s3)
    half = min(a.half_fov(180.0), 90.0)
    return Sensor(width, height, center, (focal, focal), Distortion(DistortionModel.RATIONAL, k, half))


def _lut(a: _Attributes) -> Sensor:
    width, height, center = a.nominal()
    if read(a.prim, a.name("opticalCenter"), a.when) is None:
        center = width / 2, height / 2
    name = a.name("rayEnterDirectionTexture")
    table = read_direction_table(read(a.prim, name, a.when), (width, height), center)
    if isinstance(table, str):
        raise _UnusableDistortion(f"{name}: {table}", name)
    focal, directions = table
    # The table covers the whole sensor; another optical centre shifts all of it.
    return Sensor(width, height, center, (focal, focal), Distortion(DistortionModel.TABLE, (), 180.0, directions))


_READERS: Mapping[str, Callable[[_Attributes], Sensor]] = {
    "ftheta": _ftheta,
    "kannalaBrandtK3": _kannala_brandt,
    "radTanThinPrism": _rad_tan_thin_prism,
    "lut": _lut,
    "opencvFisheye": _opencv_fisheye,
    "opencvPinhole": _opencv_pinhole,
}


SHORTEST_DIRECTION = 1e-3  # shorter than this is no direction
UNIT_TOLERANCE = 0.05  # texels whose length differs more from 1 are no directions


def read_direction_table(
    asset: object, size: tuple[float, float], center: tuple[float, float]
) -> tuple[float, DirectionTable] | str:
    """Return the focal length at the centre in pixels and the table in units of it; or a sentence on why there is none.

    Texels are centred in equal parts of the sensor, from its upper left. The lens sees nothing at texels that are (0, 0, 1)
    (straight back), (0, 0, 0) or not finite. `size` and `center` are the sensor's, in pixels; the table's axis is at the
    sensor's centre and moves with the optical centre.
    """
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return "no image of directions is given"
    if not asset.resolvedPath:
        return f"{asset.path} cannot be found"
    try:
        texture = load_texture(TextureFile(str(asset.resolvedPath), "raw"), read_asset)
    except PrimrayError as error:
        return error.message
    if texture.shape[2] < 3 or texture.stored.dtype.kind != "f":
        return f"{asset.path} does not have three float channels"
    directions = unit_directions(texture.channels(0, 3))
    if directions is None:
        return f"{asset.path} does not hold unit directions"
    width, height = size
    focal = _pixels_per_radian(directions, width, height)
    left, top = -width / 2 / focal, height / 2 / focal
    return focal, DirectionTable((left, width / focal + left, top - height / focal, top), directions)


def unit_directions(texels: np.ndarray) -> np.ndarray | None:
    """Return unit directions (H, W, 3), float32, NaN where nothing is seen; None if nothing is, or lengths are not 1."""
    found = np.array(texels, np.float64)
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(found, axis=2)
        back = (found[..., 2] > 0) & (np.hypot(found[..., 0], found[..., 1]) <= 1e-6 * length)
        seen = (length > SHORTEST_DIRECTION) & np.isfinite(length) & ~back
    if not seen.any() or np.abs(length[seen] - 1).max() > UNIT_TOLERANCE:
        return None
    found[~seen] = np.nan
    found[seen] /= length[seen][:, None]
    return found.astype(np.float32)


def _pixels_per_radian(directions: np.ndarray, width: float, height: float) -> float:
    """Return the sensor's pixels per radian at the texel whose direction is nearest to straight ahead."""
    ahead = np.nan_to_num(-directions[..., 2], nan=-2.0)
    j, i = np.unravel_index(int(ahead.argmax()), ahead.shape)
    rows, columns = ahead.shape
    scales = []
    for other, pixels in (
        ((j, i + 1 if i + 1 < columns else i - 1), width / columns),
        ((j + 1 if j + 1 < rows else j - 1, i), height / rows),
    ):
        apart = (
            float(np.linalg.norm(directions[other].astype(np.float64) - directions[j, i])) if min(rows, columns) > 1 else 0.0
        )
        if apart > 0 and np.isfinite(apart):
            scales.append(pixels / apart)
    return float(np.mean(scales)) if scales else width / 2
