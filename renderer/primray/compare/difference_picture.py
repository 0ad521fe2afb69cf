"""Difference picture of a comparison: each pixel's difference in units of its noise, blue if B is darker, red if brighter.

Changed tiles have yellow frames, undecided ones grey corners. Values are plain 8-bit, without colour management.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Doubles
from ..errors import SettingsError
from ..images.image import Image, check_output_path, write_png
from .comparison import Comparison, Verdict
from .difference import Difference, local_deviation

FULL = 4.0  # standard deviations at which the colour saturates
_DARKER, _SAME, _BRIGHTER = np.array([40.0, 90, 255]), np.array([24.0, 24, 24]), np.array([255.0, 60, 30])
_UNJUDGED = np.array([90.0, 0, 90])
_FRAMES = {Verdict.CHANGED: (255, 220, 0), Verdict.UNDECIDED: (130, 130, 130)}
_EXTENSIONS = (".png", ".exr")


def check_difference_path(path: str | os.PathLike[str]) -> Path:
    if Path(path).suffix.lower() not in _EXTENSIONS:
        known = " or ".join(_EXTENSIONS)
        raise SettingsError(f"a difference picture's name must end in {known}", where=str(path), code="unknown-extension")
    return check_output_path(path)


def save_difference(comparison: Comparison, path: str | os.PathLike[str]) -> Path:
    """Write the difference.

    A PNG holds the difference picture; an EXR holds B - A in R, G, B, and that over its noise in z.R, z.G, z.B.
    """
    path = check_difference_path(path)
    of = comparison.of
    if path.suffix.lower() == ".png":
        return write_png(picture(comparison), path)
    planes = np.concatenate([of.d[:3], z_scores(of)])
    names = ("R", "G", "B", "z.R", "z.G", "z.B")
    return Image(np.moveaxis(planes, 0, 2).astype(np.float32), channels=names, frame=of.frame).save(path)


def z_scores(of: Difference) -> Doubles:
    """Return the difference (3, H, W) in standard deviations, estimated in each pixel's neighbourhood."""
    noise = np.stack([local_deviation(of, channel) for channel in range(3)])
    return np.divide(of.d[:3], noise, out=np.zeros_like(noise), where=noise > 0)


def picture(comparison: Comparison) -> np.ndarray[Any, Any]:
    """Return the 8-bit difference picture (H, W, 3)."""
    of = comparison.of
    z = z_scores(of)
    strongest = np.take_along_axis(z, np.abs(z).argmax(axis=0)[None], axis=0)[0]
    share = np.clip(np.abs(strongest) / FULL, 0, 1)[..., None]
    colors = _SAME + share * (np.where(strongest[..., None] > 0, _BRIGHTER, _DARKER) - _SAME)
    colors[~of.judged] = _UNJUDGED
    colors[of.broken] = 255
    out: np.ndarray[Any, Any] = (colors + 0.5).astype(np.uint8)
    for verdict in (Verdict.UNDECIDED, Verdict.CHANGED):  # frames of changed tiles cover those of their neighbours
        for tile in comparison.tiles:
            if tile.verdict is verdict:
                _frame(out, tile.box, verdict)
    return out


def _frame(out: np.ndarray[Any, Any], box: tuple[int, int, int, int], verdict: Verdict) -> None:
    x0, y0, x1, y1 = box
    color = _FRAMES[verdict]
    if verdict is Verdict.CHANGED:
        out[[y0, y1 - 1], x0:x1] = color
        out[y0:y1, [x0, x1 - 1]] = color
    else:
        for y in (y0, y1 - 1):
            for x in (x0, x1 - 1):
                out[max(y - 1, y0) : min(y + 2, y1), x] = out[y, max(x - 1, x0) : min(x + 2, x1)] = color
