"""FLIP, the perceived difference when alternating between two pictures, by its authors' package (extra primray[flip]).

Scene-linear pictures use HDR-FLIP (Andersson et al. 2021), over the exposures that it chooses for the first picture; display
values use LDR-FLIP (Andersson et al. 2020), which assumes sRGB. FLIP does not model noise and does not affect the verdict.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from ..arrays import Floats
from ..color.color_space import REC709, matrix, transformed
from ..errors import SettingsError
from ..images.reading import MeasuredImage, space_of

PACKAGE = "flip_evaluator"


@dataclass(frozen=True)
class Flip:
    """FLIP errors (H, W), from 0 (no visible difference) to 1."""

    errors: Floats
    pixels_per_degree: float
    exposures: tuple[float, float, int] | None  # first and last, in stops, and their number; None: display values

    @property
    def mean(self) -> float:
        return float(self.errors.mean())

    @property
    def kind(self) -> str:
        return "LDR" if self.exposures is None else "HDR"

    def as_json(self) -> dict[str, Any]:
        return {
            "mean": self.mean,
            "largest": float(self.errors.max()),
            "kind": self.kind,
            "pixels_per_degree": self.pixels_per_degree,
            "exposures": None if self.exposures is None else dict(zip(("first", "last", "count"), self.exposures, strict=True)),
        }

    def line(self) -> str:
        degree = f"{self.pixels_per_degree:.0f} pixels a degree"
        return f"FLIP: mean {self.mean:.4f}, largest {self.errors.max():.3f} ({self.kind}, {degree})"


def has_flip() -> bool:
    return find_spec(PACKAGE) is not None


def check_flip() -> None:
    """Raise SettingsError ("flip-missing") unless the package is installed."""
    if not has_flip():
        raise SettingsError("FLIP needs a package: pip install 'primray[flip]'", where="--metric", code="flip-missing")


def flip(a: MeasuredImage, b: MeasuredImage) -> Flip:
    """Return FLIP of two pictures of the same size, the first being the reference."""
    check_flip()
    if a.resolution != b.resolution:
        raise SettingsError(f"pictures of {a.resolution} and {b.resolution} cannot be compared", code="compare-size")
    kind, shown = ("LDR", _displayed) if a.is_display else ("HDR", _shown)
    errors, _, says = import_module(PACKAGE).evaluate(shown(a), shown(b), kind, applyMagma=False, computeMeanError=False)
    exposures = None
    if not a.is_display:
        exposures = float(says["startExposure"]), float(says["stopExposure"]), int(says["numExposures"])
    return Flip(np.asarray(errors, np.float32).reshape(a.pixels.shape[:2]), float(says["ppd"]), exposures)


def _shown(image: MeasuredImage) -> Floats:
    """Return the picture in Rec.709, which FLIP expects, without negative values."""
    rgb = np.where(np.isfinite(image.pixels), image.pixels, np.float32(0))
    rgb = transformed(rgb, matrix(space_of(image.chromaticities), REC709))
    made: Floats = np.ascontiguousarray(np.maximum(rgb, 0), np.float32)
    return made


def _displayed(image: MeasuredImage) -> Floats:
    made: Floats = np.ascontiguousarray(np.clip(image.pixels, 0, 1), np.float32)
    return made
