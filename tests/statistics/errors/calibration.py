"""Renders of small stages with their true errors, for tests of what primray says of its errors.

A reference is a render of many more samples; from the squared difference to it, its own error is taken away: that of a mean of
n samples, scaled from the error seen at `spp` samples as the reference's own estimate gives it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from primray import core, usd
from primray.description import Doubles
from primray.diagnostics import Diagnostics
from primray.render import prepare
from primray.report.report import Costs
from primray.sampling.error import ALL_PIXELS, Estimate
from primray.sampling.sampling import Sampling
from primray.settings import RenderSettings

FEATURES = Path(__file__).resolve().parents[3] / "scenes" / "features"
# Light of every kind, textures, defocus, glass, glossy and instanced surfaces; the second number is the depth.
STAGES = {
    "texture": ("texture", 4),
    "sky": ("dome-texture", 4),
    "lens": ("camera-lens", 4),
    "glass": ("glass", 8),
    "emission": ("emission", 6),
    "clearcoat": ("clearcoat", 6),
    "instancer": ("point-instancer", 4),
    "interiors": ("interiors", 24),
    # Bright lights in view, small in it: a few pixels at their corners hold most of the error.
    "rectangle": ("light-rect", 6),
    "sphere": ("light-sphere", 6),
}
ROUGH = ("rectangle", "sphere")
RESOLUTION = (64, 48)


@dataclass(frozen=True)
class Case:
    """A built stage with its reference (H, W, 3) and the reference's own relMSE and MSE."""

    scene: core.CoreScene
    settings: RenderSettings
    reference: Doubles
    reference_relmse: float
    reference_mse: float

    def render(self, **changes: Any) -> Sampling:
        sampling = Sampling.begin(self.scene, replace(self.settings, **{"spp": None, **changes}))
        sampling.run()
        return sampling

    def true_relmse(self, sampling: Sampling) -> float:
        """Of the delivered picture, less the reference's own."""
        squares = self._squares(sampling)
        return float((squares / (self.reference**2 + 0.01)).mean()) - self.reference_relmse

    def true_rmse(self, sampling: Sampling) -> float:
        return max(float(self._squares(sampling).mean()) - self.reference_mse, 0.0) ** 0.5

    def _squares(self, sampling: Sampling) -> Doubles:
        squares: Doubles = (sampling.film.pixels[..., :3].astype(np.float64) - self.reference) ** 2
        return squares


@cache
def case(name: str, reference_spp: int, resolution: tuple[int, int] = RESOLUTION) -> Case:
    folder, depth = STAGES[name]
    settings = RenderSettings(resolution=resolution, max_depth=depth)
    diagnostics = Diagnostics()
    stage = usd.open_stage(str(FEATURES / folder / "scene.usda"), diagnostics, settings.composition)
    prepared = prepare(stage, diagnostics, settings, Costs(), Diagnostics())
    film = core.Film(prepared.scene)
    splits = core.choose_splits(prepared.scene, settings)
    reference_settings = replace(prepared.settings, seed=2**31)
    core.render_pass(prepared.scene, film, core.uniform_ends(film, reference_spp), splits, reference_settings)
    sums = film.error_sums(ALL_PIXELS, 2)
    return Case(
        prepared.scene,
        prepared.settings,
        film.pixels[..., :3].astype(np.float64),
        sums.relative / sums.values,
        sums.squared / sums.values,
    )


def holds(estimate: Estimate, value: float) -> bool:
    return estimate.low <= value <= estimate.high
