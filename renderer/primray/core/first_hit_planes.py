"""Data of the first hit at every pixel, for AOVs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..settings import RenderSettings
from .core_errors import raise_as_ours
from .film import TILE
from .isa_class import lanes, module
from .limits import threads
from .scene import CoreScene


@dataclass(frozen=True)
class FilmSamples:
    """Ranges of the samples that a film has taken, and how they were drawn."""

    first: npt.NDArray[np.uint32]  # (R, tiles)
    end: npt.NDArray[np.uint32]
    seed: int
    screen_block: int
    is_split: bool  # several paths continue from the first hit


BAND = 4 * TILE  # rows rendered between two checks for signals


def first_hits(
    scene: CoreScene,
    planes: Sequence[str],
    primvars: Sequence[tuple[int, int, int]],
    settings: RenderSettings,
    replicate: int = 0,
    occlusion_distance: float = 0.0,
) -> dict[str, Any]:
    """Return arrays (H, W, C) of first hits, by the core's names of planes (bindings/first_hit_bindings.cpp).

    `primvars`: the number of each, that of its wide twin, and its width, returned as a list; `replicate`: which independent set
    of samples filtered planes average over; `occlusion_distance`: in scene units, for the plane of that name.
    """
    try:
        hits = module().FirstHits(
            scene._scene, list(planes), list(primvars), replicate=replicate, occlusion_distance=occlusion_distance
        )
        for row in range(0, scene.resolution[1], BAND):
            hits.fill(lanes(), threads(settings), row, row + BAND)
    except module().CoreError as error:
        raise_as_ours(error)
    found: dict[str, Any] = hits.take()
    return found


def coverage(
    scene: CoreScene, samples: FilmSamples, settings: RenderSettings
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Return which surfaces cover each pixel, and how much.

    Number of surfaces (H, W); for all of them, pixel by pixel, (N, 4) shape, surface, instance and outer instance as
    `first_hits` numbers them; and the samples covered by each (N), as integers.
    """
    try:
        hits = module().FirstHits(scene._scene, [], [])
        link = int(samples.is_split)
        first, end = (np.ascontiguousarray(numbers, np.uint32) for numbers in (samples.first, samples.end))
        hits.want_coverage(samples.seed, samples.screen_block, link, first, end)
        for row in range(0, scene.resolution[1], BAND):
            hits.fill(lanes(), threads(settings), row, row + BAND)
    except module().CoreError as error:
        raise_as_ours(error)
    counts, what, shares = hits.take_coverage()
    return counts, what, shares
