"""What is seen first at every pixel, for the outputs beside the picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..settings import RenderSettings
from .core_errors import raise_as_ours
from .film import TILE
from .isa_class import lanes, module
from .limits import threads
from .scene import CoreScene

BAND = 4 * TILE  # rows between which signals are looked after


def first_hits(
    scene: CoreScene, planes: Sequence[str], primvars: Sequence[tuple[int, int, int]], settings: RenderSettings
) -> dict[str, Any]:
    """Arrays (H, W, C) of what is seen first, by the core's names of planes, and a list of the primvars' (its number, that of
    its wide twin, and its width); bindings/first_hit_bindings.cpp."""
    try:
        hits = module().FirstHits(scene._scene, list(planes), list(primvars))
        for row in range(0, scene.resolution[1], BAND):
            hits.fill(lanes(), threads(settings), row, row + BAND)
    except module().CoreError as error:
        raise_as_ours(error)
    found: dict[str, Any] = hits.take()
    return found
