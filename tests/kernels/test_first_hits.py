"""First hits from every number of lanes, threads and rows at a time are the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.described import core_module
from tests.kernels.scenes import SCENES

PLANES = (
    "depth",
    "distance",
    "position",
    "camera_position",
    "normal",
    "geometric_normal",
    "albedo",
    "emission",
    "prim",
    "material",
    "instance",
)


def first_hits(scene: Any, lanes: int, threads: int = 1, rows: int = 1 << 20) -> dict[str, np.ndarray]:
    hits = core_module().FirstHits(scene, list(PLANES), [])
    for row in range(0, scene.resolution[1], rows):
        hits.fill(lanes, threads, row, row + rows)
    found: dict[str, np.ndarray] = hits.take()
    del found["primvars"]
    return found


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return a.keys() == b.keys() and all(a[name].tobytes() == b[name].tobytes() for name in a)


@pytest.mark.parametrize("name", SCENES)
def test_lanes_threads_and_rows_give_the_same_bits(name: str) -> None:
    scene = SCENES[name]().build()
    one = first_hits(scene, 1)
    assert np.isfinite(one["depth"]).any()
    assert all(same(one, first_hits(scene, lanes)) for lanes in (4, 8, 16) if lanes <= core_module().MAX_LANES)
    assert same(one, first_hits(scene, core_module().MAX_LANES, threads=3, rows=5))


@pytest.mark.parametrize("name", SCENES)
def test_what_is_asked_for_beside_does_not_show(name: str) -> None:
    scene = SCENES[name]().build()
    everything = first_hits(scene, core_module().MAX_LANES)
    for plane in PLANES:
        hits = core_module().FirstHits(scene, [plane], [])
        hits.fill(core_module().MAX_LANES, 2, 0, scene.resolution[1])
        assert hits.take()[plane].tobytes() == everything[plane].tobytes()
