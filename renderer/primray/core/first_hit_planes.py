"""What is seen first at every pixel, for the outputs beside the picture."""

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
    """Which samples a film has taken, and how they were drawn."""

    first: npt.NDArray[np.uint32]  # (R, tiles)
    end: npt.NDArray[np.uint32]
    seed: int
    screen_block: int
    is_split: bool  # paths go on from the first surface in several ways


BAND = 4 * TILE  # rows between which signals are looked after


def first_hits(
    scene: CoreScene,
    planes: Sequence[str],
    primvars: Sequence[tuple[int, int, int]],
    settings: RenderSettings,
    replicate: int = 0,
    occlusion_distance: float = 0.0,
) -> dict[str, Any]:
    """Arrays (H, W, C) of what is seen first, by the core's names of planes, and a list of the primvars' (its number, that of
    its wide twin, and its width); bindings/first_hit_bindings.cpp. `replicate`: which of the independent sets of samples
    filtered planes are means of; `occlusion_distance`: in scene units, of the plane of that name."""
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
    """How many surfaces cover each pixel (H, W); of all of them, pixel by pixel, (N, 4) shape, surface, instance and outer
    instance as `first_hits` numbers them, and what they cover (N), in whole units."""
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
