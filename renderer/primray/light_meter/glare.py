"""Discomfort glare of a view: daylight glare probability (DGP) and unified glare rating (UGR), with their intervals.

DGP: Wienold and Christoffersen 2006, "Evaluation methods and development of a new glare prediction model for daylight
environments", with the correction for dim light of Wienold 2009; UGR: CIE 117. The position index is Guth's, as the IES fits
it; below the line of sight, where Guth measured nothing, it is that of tau = 90 degrees, as in Radiance's evalglare.

Sources are found in a fisheye picture: what is brighter than a multiple of the mean luminance, put together within 0.2 radians
(evalglare's rule). A source's luminance L and solid angle w are those by which L w and L^2 w are the integrals over its pixels,
so pixels that it covers in part weigh less. Noise would bias the squares; with the error e of a pixel from two replicates,
L^2 - e^2 is their product, which it does not bias. Intervals follow from the errors of the sources' luminances and of the
vertical illuminance, which a light meter reads at the eye. The upper end has what pixels on a source's rim may hide, too: a
pixel of mean v that a source of luminance L covers in part adds v^2 to the integral in place of v L.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..arrays import Doubles
from ..camera import FARTHEST, Camera, Projection, looking_at
from ..color.color_space import luminance_weights
from ..errors import SettingsError
from ..lens.distortion import Distortion, DistortionModel
from ..render.prepare import OpenedStage, open_once
from ..render.render import with_setting_names
from ..sampling.error import Z95
from ..settings import Filter, RenderSettings, with_values
from .measuring import measure
from .meters import CODE, LightMeter, Vector
from .pictures import picture_of_light, settings_of_light
from .readings import Reading

if TYPE_CHECKING:
    from ..images.image import Image
    from ..settings.written import SettingsValues

RADIUS = 0.2  # radians within which bright pixels are one source
TIMES = 5.0  # the mean luminance, from which on a pixel is one of a source
SMALLEST, LARGEST = 0.0003, 0.1  # steradians of UGR's sources (CIE 117)
PIXELS = 800  # across half of all directions: a quarter of a degree each
SAMPLES = 64
# Upper limits of the classes of DGP (EN 17037).
CLASSES = ((0.35, "imperceptible"), (0.40, "perceptible"), (0.45, "disturbing"), (math.inf, "intolerable"))

Interval = tuple[float, float, float]


@dataclass(frozen=True)
class GlareSource:
    """What dazzles: mean luminance in cd/m2 and its standard error, solid angle in steradians, unit direction in the world, and
    the position index, which is 1 in the line of sight and grows away from it."""

    luminance: float
    error: float
    solid_angle: float
    direction: Vector
    position_index: float
    cosine: float  # of its angle to the line of sight

    def as_json(self) -> dict[str, Any]:
        return {
            "luminance": self.luminance,
            "standard_error": self.error,
            "solid_angle": self.solid_angle,
            "direction": list(self.direction),
            "position_index": self.position_index,
        }


@dataclass(frozen=True)
class GlareRating:
    """Ratings of a view, each (value, low, high) with its 95 % interval, and what they follow from.

    >>> rating = primray.rate_glare("shot.usda", (0, 0, 6), (0, 0, -1), pixels=32, spp=2, target=0.2)
    >>> 0 <= rating.dgp[0] <= 1
    True
    """

    dgp: Interval
    ugr: Interval | None  # None: nothing dazzles, or nothing is around it
    vertical_illuminance: Reading
    sources: tuple[GlareSource, ...]
    background: float  # cd/m2: the mean luminance of what is no source, weighed as the eye's plane is lit
    threshold: float  # cd/m2
    report: Mapping[str, Any]

    @property
    def comfort(self) -> str:
        """The class of the DGP by EN 17037: imperceptible, perceptible, disturbing or intolerable."""
        return next(name for limit, name in CLASSES if self.dgp[0] <= limit)

    @property
    def is_valid(self) -> bool:
        """Whether DGP is within 0.2 to 0.8 at more than 380 lux, where it was fitted to people's answers."""
        return 0.2 <= self.dgp[0] <= 0.8 and self.vertical_illuminance.value > 380

    def as_json(self) -> dict[str, Any]:
        return {
            "type": "glare",
            "dgp": {"value": self.dgp[0], "ci95": list(self.dgp[1:]), "class": self.comfort, "valid": self.is_valid},
            "ugr": None if self.ugr is None else {"value": self.ugr[0], "ci95": list(self.ugr[1:])},
            "vertical_illuminance": self.vertical_illuminance.as_json(),
            "background_luminance": self.background,
            "threshold": self.threshold,
            "sources": [source.as_json() for source in self.sources],
            **self.report,
        }


@with_setting_names
def rate_glare(
    stage: str | os.PathLike[str] | Any,
    position: Vector,
    direction: Vector,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    up: Vector | None = None,
    pixels: int = PIXELS,
    threshold: float | None = None,
    target: float = 0.02,
    **values: Unpack[SettingsValues],
) -> GlareRating:
    """Rate the glare that an eye at a place of the world gets that looks in a direction, `up` being the head's (by default the
    stage's).

    >>> primray.rate_glare("shot.usda", (0, 0, 6), (0, 0, -1), pixels=32, spp=2, target=0.2).comfort
    'imperceptible'

    `pixels`: of the side of the fisheye picture; a source should cover several. `threshold`: the luminance in cd/m2 from which
    on a pixel is one of a source; None: 5 times the mean. `target`: as of `primray.measure`, for the vertical illuminance.
    `spp`: of the picture, by default 64. Luminances are in cd/m2 where the stage's lights are photometric. Lights that the
    camera does not see (`visible_to_camera`), and those of no size, light the eye's plane but are no sources.

    SettingsError: the direction is along `up`, or 0; otherwise as `primray.render`.
    """
    from .. import usd
    from ..diagnostics import Diagnostics

    settings = with_values(settings, values)
    settings_of_light(settings)  # checks them
    if not (isinstance(pixels, int) and 16 <= pixels <= 8192):
        raise SettingsError(f"a picture for glare has 16 to 8192 pixels across, not {pixels}", where="pixels", code=CODE)
    if threshold is not None and not (isinstance(threshold, int | float) and threshold > 0):
        raise SettingsError(f"a threshold is above 0, not {threshold!r}", where="threshold", code=CODE)
    meter = LightMeter("eye", position, direction)
    opened = stage if isinstance(stage, OpenedStage) else open_once(stage, settings)
    if up is None:
        up = usd.authored_meters(opened.stage, settings.time_code, Diagnostics()).up
    lit = measure(opened, [meter], replace(settings, spp=None), target=target)
    assert meter.direction is not None
    place = looking_at(meter.position, np.add(meter.position, meter.direction), up)
    asked = replace(
        settings_of_light(settings),
        camera=_fisheye(place),
        resolution=(pixels, pixels),
        filter=Filter.BOX,
        spp=SAMPLES if settings.spp is None else settings.spp,
    )
    return rating_of(picture_of_light(opened, asked), place, lit.readings[0], threshold)


def _fisheye(place: Doubles) -> Camera:
    """Return an equidistant fisheye of all directions in front."""
    half = math.pi / 2
    lens = Distortion(DistortionModel.ANGLE_TO_RADIUS, (1.0, 0.0, 0.0, 0.0, 0.0), 90.0)
    window = (-half, half, -half, half)
    return Camera("", place, Projection.PERSPECTIVE, window, (0.0, FARTHEST), distortion=lens, pixels_follow_window=True)


def rating_of(image: Image, place: Doubles, lit: Reading, threshold: float | None) -> GlareRating:
    """Return the ratings of a fisheye picture (equidistant, 180 degrees) from `place`, world_from_camera (4, 4)."""
    weights = np.array(luminance_weights(image.color_space))
    luminance = np.asarray(image.pixels[..., :3], np.float64) @ weights
    # R, G and B share their noise, so their errors add.
    errors = np.zeros_like(luminance) if image.errors is None else np.nan_to_num(np.asarray(image.errors, np.float64)) @ weights
    directions, solid = pixel_directions(luminance.shape[0])
    seen = solid > 0
    mean = float((luminance * solid)[seen].sum() / solid.sum())
    limit = TIMES * mean if threshold is None else threshold
    sources, sharp = [], []
    for rows in _apart(directions, luminance, seen & (luminance > limit)):
        omega = solid[rows]
        received = float((luminance[rows] * omega).sum())
        light = float(((luminance[rows] ** 2 - errors[rows] ** 2) * omega).sum()) / received
        slopes = (2 * luminance[rows] - light) * omega / received
        error = float(np.sqrt(((errors[rows] * slopes) ** 2).sum()))
        middle = (directions[rows] * (luminance[rows] * omega)[:, None]).sum(axis=0)
        middle /= np.linalg.norm(middle)
        x, y, z = (place[:3, :3] @ middle).tolist()
        cosine = float((directions[rows][:, 2] * -omega).sum() / omega.sum())
        source = GlareSource(light, error, received / light, (x, y, z), position_index(middle), cosine)
        most = light + _hidden_by_rim(luminance, solid, rows) / received
        sources.append(source)
        sharp.append(replace(source, luminance=most, solid_angle=received / most))
    order = sorted(range(len(sources)), key=lambda k: -sources[k].luminance * sources[k].solid_angle)
    sources, sharp = [sources[k] for k in order], [sharp[k] for k in order]
    values = np.array([source.luminance for source in sources])
    deviations = np.array([source.error for source in sources])
    e, e_error = lit.value, lit.half_width / Z95
    found, bound = tuple(sources), tuple(sharp)
    values_bound = np.array([source.luminance for source in bound])

    def rated(rating: Callable[[float, Doubles, tuple[GlareSource, ...]], float | None]) -> Interval:
        value, low, high = _with_interval(lambda e, v: rating(e, v, found) or 0.0, e, e_error, values, deviations)
        return value, low, high + max((rating(e, values_bound, bound) or 0.0) - value, 0.0)

    return GlareRating(
        dgp=rated(_dgp),
        ugr=None if _ugr(e, values, found) is None else rated(_ugr),
        vertical_illuminance=lit,
        sources=found,
        background=_background(e, values, found),
        threshold=limit,
        report={"samples": image.report["samples_per_pixel"], "pixels": luminance.shape[0]},
    )


def pixel_directions(side: int) -> tuple[Doubles, Doubles]:
    """Return unit directions (side, side, 3) in camera space of an equidistant fisheye's pixels, and their solid angles, which
    are 0 beyond 90 degrees from the axis."""
    step = math.pi / side
    x = (np.arange(side) + 0.5) * step - math.pi / 2
    across, up = np.meshgrid(x, -x)
    angle = np.hypot(across, up)
    ratio = np.sinc(angle / math.pi)  # sin(angle) / angle
    directions = np.stack([across * ratio, up * ratio, -np.cos(angle)], axis=-1)
    return directions, np.where(angle <= math.pi / 2, ratio * step * step, 0.0)


def _apart(directions: Doubles, luminance: Doubles, bright: Any) -> list[tuple[Any, Any]]:
    """Return the pixels of each source: those within RADIUS of the brightest one that is in none yet."""
    rows, columns = np.nonzero(bright)
    left = np.argsort(-luminance[rows, columns], kind="stable")
    found = []
    while len(left):
        ways = directions[rows[left], columns[left]]
        near = ways @ ways[0] >= math.cos(RADIUS)
        found.append((rows[left[near]], columns[left[near]]))
        left = left[~near]
    return found


def _hidden_by_rim(luminance: Doubles, solid: Doubles, rows: tuple[Any, Any]) -> float:
    """Return the most that a source's integral of L^2 lacks because pixels on its rim are means over it and what is around it.

    The source is taken to be as bright as the brightest of a pixel's neighbours.
    """
    inside = np.zeros(luminance.shape, bool)
    inside[rows] = True
    brightest, darkest, core, reach = luminance.copy(), luminance.copy(), inside.copy(), inside.copy()
    for across in (-1, 0, 1):
        for down in (-1, 0, 1):
            moved = np.roll(luminance, (down, across), (0, 1))
            np.maximum(brightest, moved, out=brightest)
            np.minimum(darkest, moved, out=darkest)
            core &= np.roll(inside, (down, across), (0, 1))
            reach |= np.roll(inside, (down, across), (0, 1))
    rim, around = inside & ~core, reach & ~inside & (solid > 0)
    lacking = (luminance * (brightest - luminance) * solid)[rim].sum()
    return float(lacking + ((luminance - darkest) * brightest * solid)[around].sum())


def position_index(direction: Doubles) -> float:
    """Return Guth's position index of a unit direction in camera space."""
    x, y, z = direction.tolist()
    sigma = math.degrees(math.acos(min(max(-z, -1.0), 1.0)))
    tau = 90.0 if y < 0 else math.degrees(math.atan2(abs(x), y)) if sigma > 0 else 0.0
    tilt = (35.2 - 0.31889 * tau - 1.22 * math.exp(-2 * tau / 9)) * 1e-3
    return math.exp(tilt * sigma + (21 + 0.26667 * tau - 0.002963 * tau * tau) * 1e-5 * sigma * sigma)


def _dgp(e: float, luminances: Doubles, sources: tuple[GlareSource, ...]) -> float:
    if e <= 0:
        return 0.0
    glare = sum(
        v * v * source.solid_angle / (e**1.87 * source.position_index**2)
        for v, source in zip(luminances.tolist(), sources, strict=True)
    )
    raw = 5.87e-5 * e + 9.18e-2 * math.log10(1 + glare) + 0.16
    dim = 1 / (1 + math.exp(min(4 - 0.024 * e, 700.0)))
    return min(max(raw * dim, 0.0), 1.0)


def _background(e: float, luminances: Doubles, sources: tuple[GlareSource, ...]) -> float:
    own = sum(v * source.solid_angle * source.cosine for v, source in zip(luminances.tolist(), sources, strict=True))
    return float(max(e - own, 0.0)) / math.pi


def _ugr(e: float, luminances: Doubles, sources: tuple[GlareSource, ...]) -> float | None:
    background = _background(e, luminances, sources)
    glare = sum(
        v * v * source.solid_angle / source.position_index**2
        for v, source in zip(luminances.tolist(), sources, strict=True)
        if SMALLEST <= source.solid_angle <= LARGEST
    )
    return 8 * math.log10(0.25 / background * glare) if background > 0 and glare > 0 else None


def _with_interval(
    rating: Callable[[float, Doubles], float], e: float, e_error: float, values: Doubles, deviations: Doubles
) -> Interval:
    """Return a rating with its 95 % interval, by its slope along each independent error."""
    value = rating(e, values)
    variance = ((rating(e + e_error, values) - rating(max(e - e_error, 0.0), values)) / 2) ** 2
    for k, error in enumerate(deviations.tolist()):
        aside = np.zeros(len(values))
        aside[k] = error
        variance += ((rating(e, values + aside) - rating(e, values - aside)) / 2) ** 2
    half = Z95 * math.sqrt(variance)
    return value, value - half, value + half
