"""The structure of trees: tiles of all sizes, bounds and counts of active voxels, and structures that cannot be."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from tests import vdb_writer as vdb

from primray.volumes.vdb_bytes import VdbError
from primray.volumes.vdb_file import list_grids, read_grid
from primray.volumes.volume_grid import VolumeGrid

FULL = vdb.Leaf(np.ones(512), np.ones(512, bool))


def read(grid: vdb.Grid) -> VolumeGrid:
    data = vdb.vdb_bytes([grid])
    grids = list_grids(data)
    found = read_grid(data, grids, grids[0])
    listed = grids[0].bounds
    assert grids[0].active_voxels == found.active_voxels
    assert (None if listed is None else listed.tolist()) == (None if found.bounds is None else found.bounds.tolist())
    return found


def test_an_empty_grid() -> None:
    grid = read(vdb.Grid(background=2.5))
    assert (grid.bounds, grid.active_voxels, len(grid.leaf_values), len(grid.tile_sizes)) == (None, 0, 0, 0)
    assert grid.values_at(np.array([[0, 0, 0], [-9, 1 << 30, 5]])).tolist() == [2.5, 2.5]


def test_leaves_on_both_sides_of_the_origin() -> None:
    places = [(-8, -8, -8), (0, 0, 0), (-4096, 4088, 0), (2147479552, -2147483648, 8)]
    grid = read(vdb.Grid(leaves=dict.fromkeys(places, FULL)))
    assert sorted(map(tuple, grid.leaf_origins.tolist())) == sorted(places)
    assert grid.bounds is not None
    assert grid.bounds.tolist() == [[-4096, -2147483648, -8], [2147479559, 4095, 15]]
    assert grid.active_voxels == 2048


def test_bounds_are_those_of_active_voxels() -> None:
    active = np.zeros((8, 8, 8), bool)
    active[2, 5, 1] = active[3, 4, 1] = True
    grid = read(
        vdb.Grid(
            leaves={
                (16, 0, -8): vdb.Leaf(np.ones(512), active.ravel()),
                (64, 0, 0): vdb.Leaf(np.ones(512), np.zeros(512, bool)),
            }
        )
    )
    assert grid.bounds is not None
    assert grid.bounds.tolist() == [[18, 4, -7], [19, 5, -7]]
    assert grid.active_voxels == 2


def test_tiles_that_are_neither_active_nor_different_are_left_out() -> None:
    tiles = [
        vdb.Tile((0, 0, 0), 8, 3.0),
        vdb.Tile((8, 0, 0), 8, 0.0, is_active=True),
        vdb.Tile((16, 0, 0), 8, 0.0, is_active=False),
        vdb.Tile((128, 0, 0), 128, 4.0, is_active=False),
        vdb.Tile((4096, 0, 0), 4096, 5.0),
        vdb.Tile((8192, 0, 0), 4096, 0.0, is_active=False),
    ]
    grid = read(vdb.Grid(tiles=tiles))
    found = sorted(
        zip(grid.tile_sizes.tolist(), map(tuple, grid.tile_origins.tolist()), grid.tile_values.tolist(), strict=True)
    )
    assert found == [(8, (0, 0, 0), 3.0), (8, (8, 0, 0), 0.0), (128, (128, 0, 0), 4.0), (4096, (4096, 0, 0), 5.0)]
    assert grid.active_voxels == 2 * 8**3 + 4096**3
    assert grid.bounds is not None
    assert grid.bounds.tolist() == [[0, 0, 0], [8191, 4095, 4095]]


@pytest.mark.parametrize("background", [np.nan, np.inf])
def test_tiles_of_a_background_that_is_not_finite(background: float) -> None:
    grid = read(vdb.Grid(background=background, leaves={(0, 0, 0): FULL}))
    assert len(grid.tile_sizes) == 0
    assert grid.nonfinite == 1


def test_several_buffers_are_refused() -> None:
    with pytest.raises(VdbError, match="grid 'density': its leaves have 2 buffers, not one"):
        read(vdb.Grid(buffers=2))


def test_leaves_whose_mask_differs_are_refused() -> None:
    data = bytearray(vdb.vdb_bytes([vdb.Grid(leaves={(0, 0, 0): FULL, (8, 0, 0): FULL})]))
    last = len(data) - (64 + 1 + 4 * 512)
    assert data[last : last + 64] == b"\xff" * 64
    data[last] = 0
    grids = list_grids(bytes(data))
    with pytest.raises(VdbError, match="grid 'density', leaf 1: its mask is not the one"):
        read_grid(bytes(data), grids, grids[0])


def root(tiles: list[tuple[int, int, int]], children: list[tuple[int, int, int]]) -> bytes:
    """A file whose root's table has these places; its nodes are empty."""
    data = vdb.vdb_bytes([vdb.Grid()])
    rows = b"".join(struct.pack("<3ifB", *place, 1.0, 1) for place in tiles)
    nodes = b"".join(struct.pack("<3i", *place) + bytes(8192) + b"\0" for place in children)
    own = data[:-12] + struct.pack("<fII", 0.0, len(tiles), len(children)) + rows + nodes
    at = own.index(struct.pack("<qqq", *_positions(data)))
    start, _, _ = _positions(data)
    return own[:at] + struct.pack("<qqq", start, len(own), len(own)) + own[at + 24 :]


def _positions(data: bytes) -> tuple[int, int, int]:
    at = data.index(b"Tree_float_5_4_3") + len("Tree_float_5_4_3") + 4
    first, second, third = struct.unpack_from("<qqq", data, at)
    return first, second, third


@pytest.mark.parametrize(
    ("tiles", "children", "reason"),
    [
        ([(1, 0, 0)], [], "a place in the root's table is not a multiple of 4096"),
        ([], [(0, 8, 0)], "upper node 0: a place in the root's table is not a multiple of 4096"),
        ([(0, 0, 0), (0, 0, 0)], [], "two of the root's tiles have the same place"),
        ([(0, 0, 0)], [(0, 0, 0)], "upper node 0: its place .* is out of order, or is there twice"),
        ([], [(4096, 0, 0), (0, 0, 0)], "upper node 1: its place .* is out of order, or is there twice"),
        ([], [(0, 0, 0), (0, 0, 0)], "upper node 1: its place .* is out of order, or is there twice"),
    ],
)
def test_tables_of_roots_that_cannot_be(tiles, children, reason: str) -> None:
    data = root(tiles, children)
    with pytest.raises(VdbError, match=reason):
        list_grids(data)


def test_tables_of_roots_that_can_be() -> None:
    data = root([(0, 0, 4096), (-4096, 0, 0)], [(-8192, 0, 0), (0, 0, 0)])
    grids = list_grids(data)
    assert read_grid(data, grids, grids[0]).tile_origins.tolist() == [[0, 0, 4096], [-4096, 0, 0]]


def test_values_that_are_not_finite_or_negative_are_counted_and_kept() -> None:
    values = np.ones(512, np.float32)
    values[3:8] = [np.nan, np.inf, -np.inf, -2, -0.0]
    tiles = [vdb.Tile((8, 0, 0), 8, -1.0), vdb.Tile((16, 0, 0), 8, np.inf)]
    for kind, half in (("float", False), ("float", True), ("double", False), ("half", False)):
        grid = read(vdb.Grid(kind=kind, half=half, tiles=tiles, leaves={(0, 0, 0): vdb.Leaf(values, np.ones(512, bool))}))
        assert (grid.nonfinite, grid.negative) == (4, 3), (kind, half)
        assert np.array_equal(grid.leaf_values[0].astype(np.float32), values, equal_nan=True)


def test_vectors_are_counted_once() -> None:
    values = np.ones((512, 3), np.float32)
    values[0], values[1] = (-1, -2, 3), (np.nan, np.nan, -1)
    grid = read(vdb.Grid(kind="vec3s", leaves={(0, 0, 0): vdb.Leaf(values, np.ones(512, bool))}))
    assert (grid.nonfinite, grid.negative) == (1, 2)
