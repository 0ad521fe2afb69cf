"""The difference of two images and the noise of that difference, from their error channels: the input of the tests.

A pixel's four replicate means are known as two unordered pairs, mean +- stderr of either image. If both images have the same
number of samples and nothing has changed, the four are exchangeable: each of the three ways to pair them, with either sign, is
as likely as the observed one. The mean square of the difference over these six is (d^2 + 2 (sA^2 + sB^2)) / 3, whatever the
distribution of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..description import Frame
from ..errors import SettingsError
from ..images.reading import MeasuredImage, same_color_space

ALPHA = "A"
WINDOW = 3  # radius in pixels of the neighbourhoods of local means
_FLOOR = 0.1  # times the median brightness: the smallest brightness that differences are taken relative to
_FINEST = 0.003  # relative noise of a pixel below which its weight does not increase further
_HALF_ULP = 2.0**-24  # rounding of a float channel, which the error channels do not include
_HALF_ULP_OF_HALF = 2.0**-11  # rounding of a half channel, which has 10 bits of mantissa


class Relation(Enum):
    """How the noise of the two images is related, which determines the distribution of their difference without a change."""

    EXCHANGEABLE = "as many samples in both, independent"
    UNEQUAL = "different numbers of samples, or one image without error"
    REPEATED = "the same random numbers: noise is shared"


@dataclass(frozen=True, eq=False, kw_only=True)
class Difference:
    """The difference B - A by channel. Pixels that cannot be judged are 0 in every array."""

    channels: tuple[str, ...]
    d: Doubles  # (C, H, W)
    variance_a: Doubles  # (C, H, W), unbiased estimates with one degree of freedom
    variance_b: Doubles
    mean: Doubles  # (C, H, W), of both images, weighted by samples, so that its noise is uncorrelated with that of d
    brightness: Doubles  # (H, W): product of the images averaged over R, G, B, an unbiased estimate of their squared mean
    judged: npt.NDArray[np.bool_]  # (H, W)
    broken: npt.NDArray[np.bool_]  # (H, W): finite in one image only
    floor: float  # the smallest brightness that differences are taken relative to
    relation: Relation
    samples: tuple[float | None, float | None]
    notes: tuple[str, ...]  # assumptions of the comparison
    frame: Frame | None = None  # of both pictures

    def local_mean(self, field: Doubles) -> Doubles:
        """Return means of (H, W) over each pixel's neighbourhood, independent of the pixel's own noise if that matters.

        With unequal samples, a weight correlated with a pixel's own noise would favour one image over the other (a bright
        spike in one image lowers its own weight), so each pixel uses only those of the other colour of a checkerboard.
        """
        if self.relation is Relation.UNEQUAL:
            white = checkerboard(self.judged.shape)
            return np.where(white, self._mean_over(field, ~white), self._mean_over(field, white))
        return self._mean_over(field, np.ones(self.judged.shape, bool))

    def _mean_over(self, field: Doubles, where: npt.NDArray[np.bool_]) -> Doubles:
        chosen = where & self.judged
        weight = box_sum(chosen.astype(np.float64))
        return box_sum(np.where(chosen, field, 0.0)) / np.maximum(weight, 1.0)


def checkerboard(shape: tuple[int, ...]) -> npt.NDArray[np.bool_]:
    rows, columns = np.indices(shape, sparse=True)
    white: npt.NDArray[np.bool_] = (rows + columns) % 2 == 0
    return white


def shifted_sum(field: Doubles, offsets: list[tuple[int, int]]) -> Doubles:
    """Return sums of `field` at the given (y, x) offsets from each pixel, taking 0 outside."""
    height, width = field.shape
    out = np.zeros_like(field)
    for dy, dx in offsets:
        if abs(dy) >= height or abs(dx) >= width:
            continue
        to_y, from_y = slice(max(-dy, 0), height - max(dy, 0)), slice(max(dy, 0), height + min(dy, 0))
        to_x, from_x = slice(max(-dx, 0), width - max(dx, 0)), slice(max(dx, 0), width + min(dx, 0))
        out[to_y, to_x] += field[from_y, from_x]
    return out


def box_sum(field: Doubles, radius: int = WINDOW) -> Doubles:
    """Return box sums. Running sums are not used, because one bright spike would cost its whole row the precision."""
    along = range(-radius, radius + 1)
    return shifted_sum(shifted_sum(field, [(0, x) for x in along]), [(y, 0) for y in along])


def _shown(frame: Frame) -> str:
    p, (width, height) = frame.pixels, frame.resolution
    aspect = "" if frame.pixel_aspect_ratio == 1 else f" of pixels {frame.pixel_aspect_ratio:g} as wide as high"
    return f"{p.width} x {p.height} from ({p.x}, {p.y}) of {width} x {height}{aspect}"


def difference(a: MeasuredImage, b: MeasuredImage) -> Difference:
    """Return the difference of two pictures; SettingsError if they cannot be compared."""
    if a.is_display != b.is_display:
        shown, linear = (a, b) if a.is_display else (b, a)
        sentence = (
            f"{_called(shown)} has display values ({shown.stored}), {_called(linear)} scene-linear ones ({linear.stored}): "
            "they cannot be compared. Compare the EXRs of both renders instead"
        )
        raise SettingsError(sentence, where=shown.name, code="image-display")
    if a.resolution != b.resolution:
        sizes = " and ".join(f"{width} x {height}" for width, height in (a.resolution, b.resolution))
        raise SettingsError(f"the pictures differ in size: {sizes}", where=b.name, code="image-size")
    if not same_color_space(a, b):
        names = " and ".join(str(i.metadata.get("color_space.name", i.chromaticities)) for i in (a, b))
        raise SettingsError(f"the pictures differ in colour space: {names}", where=b.name, code="image-color-space")
    if a.frame is not None and b.frame is not None and a.frame != b.frame:
        sentence = f"the pictures show different parts of their frames: {_shown(a.frame)} and {_shown(b.frame)}"
        raise SettingsError(sentence, where=b.name, code="image-size")
    notes = []
    if a.stored != b.stored:
        notes.append(f"A is stored as {a.stored}, B as {b.stored}: they differ at least by rounding")
    if a.stderr is not None or b.stderr is not None:
        notes += [
            f"{which} has no error channels: it is assumed exact" for which, i in (("A", a), ("B", b)) if i.stderr is None
        ]

    channels, pixels_a, pixels_b = _channels(a, b, notes)
    finite_a, finite_b = np.isfinite(pixels_a).all(axis=0), np.isfinite(pixels_b).all(axis=0)
    judged = finite_a & finite_b & _has_error(a) & _has_error(b)
    with np.errstate(invalid="ignore"):
        pixels_a, pixels_b = np.where(judged, pixels_a, 0.0), np.where(judged, pixels_b, 0.0)
    samples = a.samples, b.samples
    mean = _weighted_mean(pixels_a, pixels_b, samples)
    d = pixels_b - pixels_a
    largest = np.maximum(np.abs(pixels_a), np.abs(pixels_b))
    variance_a = _variance(a, judged, mean, channels) + _rounding(a, largest)
    variance_b = _variance(b, judged, mean, channels) + _rounding(b, largest)
    variance_a[:, ~judged] = variance_b[:, ~judged] = 0.0
    colors = slice(0, 3)
    level = np.abs(mean[colors]).mean(axis=0)[judged]
    lit = level[level > 0]
    return Difference(
        channels=channels,
        d=d,
        variance_a=variance_a,
        variance_b=variance_b,
        mean=mean,
        brightness=(pixels_a[colors] * pixels_b[colors]).mean(axis=0),
        judged=judged,
        broken=finite_a != finite_b,
        floor=float(_FLOOR * np.median(lit)) if lit.size else 0.0,
        relation=_relation(a, b, d[colors], (variance_a + variance_b)[colors]),
        samples=samples,
        notes=tuple(notes),
        frame=a.frame,
    )


def _called(picture: MeasuredImage) -> str:
    return picture.name or "the picture"


def _rounding(picture: MeasuredImage, largest: Doubles) -> Doubles:
    """Return the variance of rounding in the file, which is 0 for pictures that are assumed exact."""
    half_ulp = _HALF_ULP_OF_HALF if picture.stored == "half" else _HALF_ULP
    found: Doubles = (half_ulp * largest) ** 2 * (picture.stderr is not None)
    return found


def _channels(a: MeasuredImage, b: MeasuredImage, notes: list[str]) -> tuple[tuple[str, ...], Doubles, Doubles]:
    """Return channel names and values (C, H, W) of either image: R, G, B and, if it can be judged, alpha."""
    names: tuple[str, ...] = ("R", "G", "B")
    planes = [np.moveaxis(image.pixels.astype(np.float64), 2, 0) for image in (a, b)]
    if a.alpha is None and b.alpha is None:
        return names, planes[0], planes[1]
    counted = all(image.stderr is None or image.samples is not None for image in (a, b))
    if a.alpha is None or b.alpha is None or not counted:
        notes.append("alpha is not compared: a picture does not have it, or does not state its samples")
        return names, planes[0], planes[1]
    with_alpha = [
        np.concatenate([plane, image.alpha[None]])
        for plane, image in zip(planes, (a, b), strict=True)
        if image.alpha is not None
    ]
    return (*names, ALPHA), with_alpha[0], with_alpha[1]


def _has_error(image: MeasuredImage) -> npt.NDArray[np.bool_]:
    if image.stderr is None:
        return np.ones(image.pixels.shape[:2], bool)
    return np.asarray(np.isfinite(image.stderr).all(axis=2), bool)


def _weighted_mean(a: Doubles, b: Doubles, samples: tuple[float | None, float | None]) -> Doubles:
    na, nb = samples
    return (na * a + nb * b) / (na + nb) if na and nb else (a + b) / 2


def _variance(image: MeasuredImage, judged: npt.NDArray[np.bool_], mean: Doubles, channels: tuple[str, ...]) -> Doubles:
    """Return variances (C, H, W): the squared error channels.

    Alpha, which has none, gets the maximum for a coverage in [0, 1].
    """
    out = np.zeros(mean.shape)
    if image.stderr is None:
        return out
    out[:3] = np.where(judged, np.moveaxis(image.stderr.astype(np.float64), 2, 0), 0.0) ** 2
    if ALPHA in channels and image.samples:
        coverage = np.clip(mean[3], 0.0, 1.0)
        out[3] = coverage * (1 - coverage) / image.samples
    return out


def _relation(a: MeasuredImage, b: MeasuredImage, d: Doubles, variance: Doubles) -> Relation:
    span_a, span_b = a.sample_span, b.sample_span
    if a.stderr is None or b.stderr is None or span_a is None or span_a != span_b or span_a[0] != span_a[1]:
        return Relation.UNEQUAL
    seed = a.metadata.get("settings.seed")
    noisy = variance > 0
    # Independent differences are about as large as their noise; with repeated random numbers most are 0.
    if seed is not None and seed == b.metadata.get("settings.seed") and noisy.any():
        ratio = d[noisy] ** 2 / variance[noisy]
        if float(np.median(ratio)) < 0.1:
            return Relation.REPEATED
    return Relation.EXCHANGEABLE


def local_deviation(of: Difference, channel: int) -> Doubles:
    """Return the standard deviation (H, W) of the difference by the error channels alone, over each pixel's neighbourhood.

    If both images share their noise, the error channels do not describe the difference, and only the floor is used.
    """
    around = of.local_mean(of.mean[channel])
    variance = of.local_mean(of.variance_a[channel] + of.variance_b[channel])
    finest = (_FINEST**2) * (around**2 + of.floor**2)
    return np.sqrt(finest if of.relation is Relation.REPEATED else variance + finest)


def local_precision(of: Difference, channel: int) -> tuple[Doubles, Doubles]:
    """Return the channel's mean (H, W) around every pixel, and the inverse variance (H, W) of the difference there."""
    around = of.local_mean(of.mean[channel])
    variance = of.local_mean(of.d[channel] ** 2 / 3 + (of.variance_a[channel] + of.variance_b[channel]) * 2 / 3)
    finest = (_FINEST**2) * (around**2 + of.floor**2)
    total = variance + finest
    return around, np.where(of.judged & (total > 0), 1.0 / np.where(total > 0, total, 1.0), 0.0)
