"""Damaged files: each is read or refused by a VdbError with a place, soon, and in memory that its size bounds."""

from __future__ import annotations

import gc
import struct
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from tests import vdb_writer as vdb

from primray.volumes.vdb_bytes import VdbError
from primray.volumes.vdb_file import list_grids, read_grid

FILES = Path(__file__).parent / "files"
SLOWEST_S = 10.0  # of a file that takes 10 ms on an idle machine
MOST_BYTES = 64 << 20  # a whole node of 32^3 tiles of three doubles has a few copies of 0.8 MB
EXTREMES = (0, 1, 7, 0x7F, 0xFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)


def originals() -> list[bytes]:
    flags = [0, vdb.ACTIVE_MASK, vdb.ZIP | vdb.ACTIVE_MASK, vdb.BLOSC | vdb.ACTIVE_MASK, vdb.BLOSC]
    kinds = [("float", False), ("float", True), ("vec3s", True), ("double", False), ("int64", False), ("bool", False)]
    leaves = dict(list(vdb.sample_grid().leaves.items())[:3])
    made = [
        vdb.vdb_bytes([vdb.Grid(kind=kind, half=half, leaves=leaves, compression=own)])
        for kind, half in kinds[:2]
        for own in flags
    ]
    made += [vdb.vdb_bytes([vdb.sample_grid(kind, half, flags[k % len(flags)])]) for k, (kind, half) in enumerate(kinds)]
    made.append(vdb.vdb_bytes([vdb.sample_grid(), vdb.Grid(name="again", parent="density")], has_offsets=False))
    return [*made, *(path.read_bytes() for path in sorted(FILES.glob("*.vdb")))]


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip bits, replace numbers by extreme ones, cut, remove, repeat or zero a range."""
    out = bytearray(data)

    def place(last: int) -> int:
        """Half of the places are at the beginning, where the counts are."""
        return int(rng.integers(0, min(last, 700) if rng.random() < 0.5 else last))

    match rng.integers(0, 7):
        case 0:
            for _ in range(rng.integers(1, 9)):
                out[place(len(out))] ^= 1 << int(rng.integers(0, 8))
        case 1:
            for _ in range(rng.integers(1, 9)):
                out[place(len(out))] = int(rng.integers(0, 256))
        case 2 | 3:
            size = int(rng.choice([1, 4, 8]))
            value = int(EXTREMES[rng.integers(0, len(EXTREMES))]) & ((1 << 8 * size) - 1)
            at = place(len(out) - 8)
            out[at : at + size] = struct.pack("<Q", value)[:size]
        case 4:
            del out[place(len(out)) :]
        case 5:
            at = place(len(out))
            del out[at : at + int(rng.integers(1, 100))]
        case 6:
            at, count = place(len(out)), int(rng.integers(1, 300))
            out[at:at] = out[at : at + count] if rng.random() < 0.5 else bytes(count)
    return bytes(out)


def read_all(data: bytes) -> str:
    """Read every grid of a file; return what was refused, "" if nothing was."""
    try:
        grids = list_grids(data)
    except VdbError as error:
        return str(error)
    refused = ""
    for info in grids:
        try:
            grid = read_grid(data, grids, info)
            with np.errstate(all="ignore"):
                grid.sample(np.array([[0.5, 0.5, 0.5], [-20.25, 17, -3]]))
        except VdbError as error:
            refused = str(error)
    return refused


def check(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    files = originals()
    assert all(read_all(data) == "" for data in files)
    refused = 0
    for k in range(count):
        data = damaged(files[k % len(files)], rng)
        tracemalloc.reset_peak()
        before, start = tracemalloc.get_traced_memory()[0], time.perf_counter()
        said = read_all(data)
        peak = tracemalloc.get_traced_memory()[1] - before
        assert time.perf_counter() - start < SLOWEST_S, (seed, k)
        assert peak < MOST_BYTES, (seed, k, peak)
        assert not said or said.startswith(("the file", "grid ")), (seed, k, said)
        refused += bool(said)
    assert refused > count / 4


pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(autouse=True)
def _memory_is_traced():
    tracemalloc.start()
    yield
    tracemalloc.stop()


def test_sixty_damaged_files() -> None:
    check(seed=1, count=60)


@pytest.mark.long
def test_two_thousand_damaged_files_leave_nothing_behind() -> None:
    check(seed=2, count=200)
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    check(seed=3, count=1800)
    gc.collect()
    assert tracemalloc.get_traced_memory()[0] - before < 1 << 20


def test_every_length_of_a_small_file_is_refused() -> None:
    data = vdb.vdb_bytes([vdb.Grid(leaves={}, tiles=[vdb.Tile((0, 0, 0), 4096, 1.0)])])
    assert read_all(data) == ""
    for length in range(len(data)):
        assert read_all(data[:length]), length
