"""Every type of value in every compression, with every code of inactive values: each voxel is what was written."""

from __future__ import annotations

import struct
import sys
import zlib

import numpy as np
import pytest
from tests import vdb_writer as vdb

from primray.volumes.vdb_bytes import VdbBytes, VdbError
from primray.volumes.vdb_file import list_grids, read_grid
from primray.volumes.vdb_values import chunk_reader, read_inactive, value_type

COMPRESSIONS = [
    pytest.param(flags, id=name)
    for name, flags in (
        ("none", 0),
        ("mask", vdb.ACTIVE_MASK),
        ("zip", vdb.ZIP),
        ("zip-mask", vdb.ZIP | vdb.ACTIVE_MASK),
        ("blosc", vdb.BLOSC),
        ("blosc-mask", vdb.BLOSC | vdb.ACTIVE_MASK),
    )
]
KINDS = [(kind, half) for kind in vdb.TYPES for half in (False, True) if not half or kind[-1] in "tds"]
VOXELS = np.concatenate(
    [
        np.stack(np.meshgrid(np.arange(-26, 34), np.arange(15, 25), np.arange(-9, 1), indexing="ij"), -1).reshape(-1, 3),
        np.stack(np.meshgrid(np.arange(-9, 25), np.arange(9), np.arange(9), indexing="ij"), -1).reshape(-1, 3),
        np.random.default_rng(2).integers(-4200, 8400, (1000, 3)),
        np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), -1).reshape(-1, 3) + (4096 + 8, 0, -4096),
        np.array([(-128, 256, 0), (-1, 383, 127), (-4096, 8192, 0), (-1, 12287, 4095), (0, 12287, 4095), (0, -8192, 4096)]),
    ]
)


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize(("kind", "half"), KINDS)
def test_each_voxel_is_what_was_written(kind: str, half: bool, compression: int) -> None:
    written = vdb.sample_grid(kind, half, compression)
    data = vdb.vdb_bytes([written])
    (info,) = list_grids(data)
    grid = read_grid(data, [info], info)
    is_half = kind == "half" or (half and kind in ("float", "double", "vec3s", "vec3d"))
    assert (info.value_type, info.is_half) == (kind, is_half and kind != "half")
    assert grid.leaf_values.dtype == (np.float16 if is_half else np.float32)
    assert np.array_equal(grid.values_at(VOXELS).reshape(len(VOXELS), -1), vdb.values_of(written, VOXELS).astype(np.float32))
    assert grid.active_voxels == info.active_voxels == vdb.active_voxels(written)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_leaves_without_inactive_voxels(compression: int) -> None:
    values = np.linspace(0, 1, 512).astype(np.float32)
    data = vdb.vdb_bytes([vdb.Grid(leaves={(0, 0, 0): vdb.Leaf(values, np.ones(512, bool))}, compression=compression)])
    grids = list_grids(data)
    grid = read_grid(data, grids, grids[0])
    assert np.array_equal(grid.leaf_values[0], values)


def test_unknown_types() -> None:
    assert value_type("string", False) is None
    assert value_type("ptdataidx32", True) is None


@pytest.mark.parametrize("size", [-8, 7, 1 << 40, -(1 << 40)])
def test_sizes_that_are_not_the_values_are_refused(size: int) -> None:
    kind = value_type("float", False)
    assert kind is not None
    data = struct.pack("<q", size) + bytes(40)
    with pytest.raises(VdbError, match="its values"):
        chunk_reader(kind, vdb.ZIP)(data, 0, len(data), 16)


@pytest.mark.parametrize(
    "chunk",
    [
        zlib.compress(bytes(15)),
        zlib.compress(bytes(17)),
        zlib.compress(bytes(1 << 20)),
        zlib.compress(bytes(16))[:-1],
        zlib.compress(bytes(16))[:-1] + b"x",
        b"nothing",
    ],
)
def test_zip_chunks_decompress_to_exactly_what_the_masks_give(chunk: bytes) -> None:
    kind = value_type("float", False)
    assert kind is not None
    data = struct.pack("<q", len(chunk)) + chunk
    with pytest.raises(VdbError, match=r"decompress"):
        chunk_reader(kind, vdb.ZIP)(data, 0, len(data), 16)


@pytest.mark.parametrize(
    ("offset", "code", "value"),
    [(4, "<I", 1 << 30), (4, "<I", 15), (12, "<I", 20), (8, "<I", 0), (8, "<I", 1 << 30), (3, "<B", 0), (0, "<B", 99)],
)
def test_headers_of_blosc_chunks_are_checked(offset: int, code: str, value: int) -> None:
    import blosc

    chunk = bytearray(blosc.compress(bytes(4096), typesize=4))
    struct.pack_into(code, chunk, offset, value)
    kind = value_type("float", False)
    assert kind is not None
    data = struct.pack("<q", len(chunk)) + bytes(chunk)
    with pytest.raises(VdbError, match=r"its Blosc chunk|its values cannot be decompressed"):
        chunk_reader(kind, vdb.BLOSC)(data, 0, len(data), 4096)


def test_files_without_blosc_do_not_load_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "blosc", None)
    data = vdb.vdb_bytes([vdb.sample_grid(compression=vdb.ZIP | vdb.ACTIVE_MASK)])
    grids = list_grids(data)
    assert len(read_grid(data, grids, grids[0]).leaf_values) == 9


def test_the_number_of_threads_of_others_is_kept() -> None:
    import blosc

    before = blosc.set_nthreads(2)
    try:
        data = vdb.vdb_bytes([vdb.sample_grid(compression=vdb.BLOSC)])
        grids = list_grids(data)
        read_grid(data, grids, grids[0])
        assert blosc.set_nthreads(2) == 2
    finally:
        blosc.set_nthreads(before)


def test_an_unknown_code_of_inactive_values_is_refused() -> None:
    kind = value_type("float", False)
    assert kind is not None
    with pytest.raises(VdbError, match="a leaf: the code of its inactive values is 7"):
        read_inactive(VdbBytes(bytes(200), "a leaf"), 7, kind, np.zeros(1, np.float32), 64)
