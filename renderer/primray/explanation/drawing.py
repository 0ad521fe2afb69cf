"""Noise paths drawn: over the picture as a PNG, and in the scene as a USD layer of curves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..camera import Camera, Projection
from ..errors import SettingsError
from ..images.image import write_png, write_text

if TYPE_CHECKING:
    from ..images.image import Image
    from .explained import ExplainedPixel
    from .noise import NoisePath

STEPS = 8  # of a straight piece of a path, before it is cut finer where a lens bends it, or where it leaves the view
FINEST = 14  # halvings of a step at most
LONGEST_BENT, LONGEST_STRAIGHT = 6.0, 1.0  # steps in the picture: pixels, sides of the picture
BY_NOISE, AT_RANDOM, PIXEL = (1.0, 0.45, 0.05), (0.25, 0.6, 1.0), (0.1, 1.0, 0.3)
FAINTEST = 0.15  # opacity
HALF_WIDTH = 1.2  # pixels


def opacity_of(path: NoisePath, largest: float) -> float:
    """Return the opacity of a path by its share: the root, since shares are squares."""
    return max(math.sqrt(path.share / largest), FAINTEST) if largest > 0 else FAINTEST


def overlay(image: Image, pixel: ExplainedPixel) -> npt.NDArray[np.uint8]:
    """Return the picture (H, W, 3) with the paths drawn over it: orange by share of the noise, blue at random."""
    shown = image.to_uint8()[..., :3].astype(np.float64) / 255 * 0.6  # darker, so that the lines stand out
    height, width = shown.shape[:2]
    if (width, height) != pixel.frame:
        sentence = f"the picture has {width} x {height} pixels, and the pixel's frame {pixel.frame[0]} x {pixel.frame[1]}"
        raise SettingsError(sentence, where="image", code="explain-picture")
    largest = max((path.share for path in pixel.noise), default=0.0)
    for path in sorted(pixel.noise, key=lambda path: (not path.is_random, path.share)):
        color = AT_RANDOM if path.is_random else BY_NOISE
        # The way from the lens is a point where the lens is one; beside the middle of another it would sweep through the view.
        if len(path.points) > 2:
            seen = _projected(pixel.seen_by, path.points[1:], (width, height))
            _draw(shown, seen, color, opacity_of(path, largest))
    _mark(shown, *pixel.pixel)
    return (np.clip(shown, 0, 1) * 255 + 0.5).astype(np.uint8)


def save_overlay(image: Image, pixel: ExplainedPixel, path: Path) -> None:
    write_png(overlay(image, pixel), path)


def save_layer(stage: Any, pixel: ExplainedPixel, path: Path) -> None:
    """Write the paths as a USD layer, with curves as wide as a pixel where the paths begin."""
    from .. import usd

    largest = max((one.share for one in pixel.noise), default=0.0)
    curves = {
        name: [
            (one.points, color, opacity_of(one, largest))
            for one in pixel.noise
            if one.is_random is is_random and len(one.points) > 1
        ]
        for name, color, is_random in (("by_noise", BY_NOISE, False), ("at_random", AT_RANDOM, True))
    }
    about = {
        "pixel": list(pixel.pixel),
        "camera": pixel.camera,
        "samples": pixel.samples,
        "value": list(pixel.value),
        **{
            name: {
                "share": [one.share for one in pixel.noise if one.is_random is is_random],
                "light": [one.light for one in pixel.noise if one.is_random is is_random],
                "expression": [one.expression for one in pixel.noise if one.is_random is is_random],
            }
            for name, is_random in (("by_noise", False), ("at_random", True))
        },
    }
    write_text(path, usd.light_path_layer(stage, curves, _width(pixel.seen_by, pixel), about))


def _width(camera: Camera, pixel: ExplainedPixel) -> float:
    """Return the height of a pixel in scene units where its ray meets the scene."""
    _, _, bottom, top = camera.window
    size = abs(top - bottom) / pixel.frame[1]
    if camera.projection is not Projection.PERSPECTIVE:
        return size
    lengths = [math.dist(one.points[0], one.points[1]) for one in pixel.noise if len(one.points) > 1]
    distance = pixel.shown.distance if pixel.shown is not None else min(lengths, default=1.0)
    return size * distance


def _projected(camera: Camera, points: Sequence[tuple[float, float, float]], resolution: tuple[int, int]) -> Doubles:
    """Return the line through the points as pixel positions (N, 2), NaN where the camera does not see it.

    Equal steps along a path are steps of any size in the picture: what passes near the camera sweeps through the whole view at
    once. Steps are halved where they are long in the picture, and where the line leaves the view. What is long even then is a
    seam of a picture of all directions, which is no part of the line.
    """
    corners, size = np.asarray(points, np.float64), np.asarray(resolution, np.float64)
    longest = LONGEST_STRAIGHT * size.max() if camera.distortion is None else LONGEST_BENT

    def seen_at(along: Doubles) -> Doubles:
        line = np.stack([np.interp(along, np.arange(len(corners)), corners[:, k]) for k in range(3)], axis=1)
        return camera.project(line, resolution)

    def steps_of(seen: Doubles) -> tuple[Doubles, npt.NDArray[np.bool_]]:
        """Return the steps' lengths, NaN where one end is not seen, and whether an end is near the picture."""
        near = np.asarray(((seen > -size) & (seen < 2 * size)).all(axis=1))
        return np.abs(np.diff(seen, axis=0)).max(axis=1), near[:-1] | near[1:]

    along = np.linspace(0, len(corners) - 1, STEPS * (len(corners) - 1) + 1)
    seen = seen_at(along)
    for _ in range(FINEST):
        lengths, near = steps_of(seen)
        cut = np.flatnonzero(near & ~(lengths <= longest))
        if not len(cut):
            break
        between = (along[cut] + along[cut + 1]) / 2
        along, seen = np.insert(along, cut + 1, between), np.insert(seen, cut + 1, seen_at(between), axis=0)
    lengths, near = steps_of(seen)
    seams = np.flatnonzero(near & (lengths > longest)) + 1
    return np.insert(seen, seams, np.nan, axis=0)


def _draw(shown: Doubles, line: Doubles, color: tuple[float, float, float], opacity: float) -> None:
    """Draw a line over the picture, antialiased by the distance from its middle."""
    height, width = shown.shape[:2]
    cover = np.zeros((height, width))
    for a, b in pairwise(line):
        for piece in _inside(a, b, (width, height)):
            _cover(cover, *piece)
    weight = (cover * opacity)[..., None]
    shown[:] = shown * (1 - weight) + np.array(color) * weight


def _inside(a: Doubles, b: Doubles, size: tuple[int, int]) -> Iterator[tuple[Doubles, Doubles]]:
    """Yield the piece if it is seen and near the picture: the rest of a long one is far outside."""
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        return
    low, high = np.minimum(a, b), np.maximum(a, b)
    if (high >= -2).all() and low[0] <= size[0] + 2 and low[1] <= size[1] + 2 and np.abs(b - a).max() < 4 * max(size):
        yield a, b


def _cover(cover: Doubles, a: Doubles, b: Doubles) -> None:
    height, width = cover.shape
    x0, y0 = np.maximum(np.floor(np.minimum(a, b) - HALF_WIDTH - 1), 0).astype(int)
    x1, y1 = np.minimum(np.ceil(np.maximum(a, b) + HALF_WIDTH + 1), (width, height)).astype(int)
    if x0 >= x1 or y0 >= y1:
        return
    y, x = np.mgrid[y0:y1, x0:x1] + 0.5
    along = b - a
    square = float(along @ along)
    t = np.clip(((x - a[0]) * along[0] + (y - a[1]) * along[1]) / square, 0, 1) if square > 0 else np.zeros_like(x)
    distance = np.hypot(x - a[0] - t * along[0], y - a[1] - t * along[1])
    part = np.clip(HALF_WIDTH + 0.5 - distance, 0, 1)
    np.maximum(cover[y0:y1, x0:x1], part, out=cover[y0:y1, x0:x1])


def _mark(shown: Doubles, x: int, y: int) -> None:
    """Draw a frame around the pixel."""
    height, width = shown.shape[:2]
    around = max(round(0.012 * width), 3)
    for dy in range(-around, around + 1):
        for dx in range(-around, around + 1):
            row, column = y + dy, x + dx
            if max(abs(dx), abs(dy)) == around and 0 <= row < height and 0 <= column < width:
                shown[row, column] = PIXEL
