"""First hits from every number of lanes, threads and rows at a time are the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.described import core_module
from tests.kernels.scenes import SCENES

from primray.aovs import AOVS
from primray.core import compiled

PLANES = tuple(compiled.FirstHits.widths_of_planes())


def test_planes_are_aovs_of_the_same_name_and_width() -> None:
    """Except for the instance around the one that was hit, and AOVs that are made of other planes."""
    widths = compiled.FirstHits.widths_of_planes()
    made = {"camera_normal", "samples", "st"}
    assert {name: len(kind.channels) for name, kind in AOVS.items() if name not in made} | {"outer": 1} == widths
    assert made < AOVS.keys()


def test_a_plane_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(compiled.CoreError, match="no first-hit plane 'dept'"):
        compiled.FirstHits(SCENES["materials"]().build(), ["dept"], [])


def first_hits(scene: Any, lanes: int, threads: int = 1, rows: int = 1 << 20) -> dict[str, np.ndarray]:
    hits = core_module().FirstHits(scene, list(PLANES), [], occlusion_distance=1.0)
    for row in range(0, scene.resolution[1], rows):
        hits.fill(lanes, threads, row, row + rows)
    found: dict[str, np.ndarray] = hits.take()
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
        hits = core_module().FirstHits(scene, [plane], [], occlusion_distance=1.0)
        hits.fill(core_module().MAX_LANES, 2, 0, scene.resolution[1])
        assert hits.take()[plane].tobytes() == everything[plane].tobytes()


@pytest.mark.parametrize("name", SCENES)
def test_what_covers_pixels_is_the_same_at_any_lanes_and_in_parts(name: str) -> None:
    scene = SCENES[name]().build()
    width, height = scene.resolution
    tiles = -(-width // 16) * -(-height // 16)

    def covering(lanes: int, first: int, end: int) -> dict[tuple[int, ...], int]:
        hits = core_module().FirstHits(scene, [], [])
        numbers = [np.full((2, tiles), n, np.uint32) for n in (first, end)]
        hits.want_coverage(7, 0, 0, *numbers)
        hits.fill(lanes, 2, 0, height)
        counts, what, shares = hits.take_coverage()
        pixel = np.repeat(np.arange(counts.size), counts.ravel())
        rows = [(int(p), *map(int, w)) for p, w in zip(pixel, what, strict=True)]
        return dict(zip(rows, shares.tolist(), strict=True))

    whole = covering(1, 0, 3)
    assert whole
    assert covering(core_module().MAX_LANES, 0, 3) == whole
    parts = [covering(4, *part) for part in ((0, 1), (1, 3))]
    assert {key: sum(part.get(key, 0) for part in parts) for key in parts[0] | parts[1]} == whole


@pytest.mark.parametrize("name", SCENES)
def test_layers_begin_with_the_first_hits_and_are_the_same_at_any_lanes(name: str) -> None:
    described = SCENES[name]()
    scene, window = described.build(), described.description.frame.pixels
    width, height = scene.resolution
    centres = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1).reshape(-1, 2)
    points = (centres + [window.x, window.y]).astype(np.float32)

    def layers(lanes: int, threads: int, first_only: bool = False) -> tuple[np.ndarray, ...]:
        found: tuple[np.ndarray, ...] = core_module().layers(scene, points, first_only, lanes, threads)
        return found

    one = layers(1, 1)
    for again in (layers(core_module().MAX_LANES, 3), layers(4, 1)):
        assert all(a.tobytes() == b.tobytes() for a, b in zip(one, again, strict=True))
    count, what, lengths = one
    starts = (np.cumsum(count) - count)[count > 0]
    hits = first_hits(scene, 1)
    assert np.array_equal((count > 0).reshape(height, width), hits["prim"][..., 0] != -1)
    for column, plane in enumerate(("prim", "instance", "outer")):
        assert np.array_equal(what[starts, column], hits[plane].ravel()[count > 0])
    assert np.array_equal(lengths[starts, 0], hits["depth"].ravel()[count > 0])
    firsts = layers(8, 2, first_only=True) if core_module().MAX_LANES >= 8 else layers(4, 2, first_only=True)
    assert np.array_equal(firsts[1], what[starts])
    assert firsts[0].max() <= 1
