"""What one sequence over the screen brings to pictures of one sample: python -m tests.bench.quick_looks.

Errors of pixels and of blurred pictures, each over what it is where pixels have sequences of their own. Errors are differences
of two seeds' pictures, over the scene's converged picture (references.py), cut off at 1, or rare bright pixels would decide.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.bench.cores.replay import build
from tests.bench.figures.relmse import DARK, saved

from primray import core
from primray.settings import RenderSettings

from .peers.scenes import SCENES
from .references import path_of
from .results import write_results
from .scenes import bench_scene

PAIRS = 8  # of seeds
BLURS = (0, 1, 2, 4)  # standard deviations of a Gaussian, pixels

Picture = npt.NDArray[np.float64]


class OwnSequences(RenderSettings):
    @property
    def screen_block(self) -> int:
        return 0


def blurred(picture: Picture, sigma: int) -> Picture:
    if sigma == 0:
        return picture
    weights = np.exp(-0.5 * (np.arange(-3 * sigma, 3 * sigma + 1) / sigma) ** 2)
    for axis in (0, 1):
        picture = np.apply_along_axis(np.convolve, axis, picture, weights / weights.sum(), "valid")
    return picture


def errors(scene: core.CoreScene, settings: RenderSettings, reference: Picture) -> list[float]:
    """Mean squares by blur, of all pairs."""
    sums = np.zeros(len(BLURS))
    for pair in range(PAIRS):
        pictures = []
        for seed in (2 * pair, 2 * pair + 1):
            film = core.Film(scene)
            core.render_pass(scene, film, core.uniform_ends(film, 1), core.Splits(), replace(settings, seed=seed))
            pictures.append(film.pixels[..., :3].astype(float))
        off = (pictures[0] - pictures[1]) / np.sqrt(2 * (reference**2 + DARK))
        sums += [(blurred(np.clip(off, -1, 1), sigma) ** 2).mean() for sigma in BLURS]
    return [float(s) for s in sums / PAIRS]


def measure(name: str) -> dict[str, Any]:
    scene, settings = build(bench_scene(name), 1)
    settings = replace(settings, threads=None)
    reference = saved(path_of(name, "primray")).pixels
    own = errors(scene, OwnSequences(**vars(settings)), reference)
    screen = errors(scene, settings, reference)
    ratios = [round(a / b, 3) for a, b in zip(screen, own, strict=True)]
    return {"scene": name, "blurs": BLURS, "ratios": ratios}


def report() -> None:
    rows = []
    for name in SCENES:
        rows.append(row := measure(name))
        print(f"{name:8}", " ".join(f"{ratio:.3f}" for ratio in row["ratios"]), flush=True)
    write_results("quick-looks", rows)


if __name__ == "__main__":
    report()
