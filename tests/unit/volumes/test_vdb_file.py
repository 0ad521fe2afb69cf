"""What a file lists of its grids, which of them is read, and files that are refused."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from tests import vdb_writer as vdb

from primray.volumes.vdb_bytes import UnsupportedVdbError, VdbError
from primray.volumes.vdb_file import find_grid, list_grids, read_grid

ONE_LEAF = {(0, 0, 0): vdb.Leaf(np.full(512, 2.0), np.ones(512, bool))}
STATISTICS = {
    "file_voxel_count": ("int64", struct.pack("<q", 77)),
    "file_bbox_min": ("vec3i", struct.pack("<3i", -1, -2, -3)),
    "file_bbox_max": ("vec3i", struct.pack("<3i", 4, 5, 6)),
}


def test_metadata_by_type() -> None:
    metadata = {
        "class": vdb.string("fog volume"),
        "a": ("bool", b"\1"),
        "b": ("int32", struct.pack("<i", -5)),
        "c": ("double", struct.pack("<d", 0.25)),
        "d": ("vec3s", struct.pack("<3f", 1, 2, 3)),
        "e": ("vec2i", struct.pack("<2i", 1, -2)),
        "f": ("__delayedload", b"anything"),
        "g": ("string", "Größe".encode()),
    }
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid(metadata=metadata)]))
    assert info.grid_class == "fog volume"
    own = {name: value for name, value in info.metadata.items() if len(name) == 1}
    assert own == {"a": True, "b": -5, "c": 0.25, "d": (1, 2, 3), "e": (1, -2), "g": "Größe"}


def test_metadata_of_a_wrong_size_are_refused() -> None:
    with pytest.raises(VdbError, match="grid 'density', metadata 1: 'x' has 3 bytes, which is no int32"):
        list_grids(vdb.vdb_bytes([vdb.Grid(metadata={"x": ("int32", b"abc")})]))


def test_the_class_is_unknown_where_it_is_not_said() -> None:
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid()]))
    assert info.grid_class == "unknown"


def test_statistics_are_those_of_the_metadata_where_there_are_any() -> None:
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid(metadata=STATISTICS, leaves=ONE_LEAF)]))
    assert info.active_voxels == 77
    assert info.bounds is not None
    assert info.bounds.tolist() == [[-1, -2, -3], [4, 5, 6]]


@pytest.mark.parametrize("missing", STATISTICS)
def test_statistics_are_counted_where_metadata_lack_one(missing: str) -> None:
    own = {name: value for name, value in STATISTICS.items() if name != missing}
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid(metadata=own, leaves=ONE_LEAF)]))
    assert info.active_voxels == 512
    assert info.bounds is not None
    assert info.bounds.tolist() == [[0, 0, 0], [7, 7, 7]]


def test_listing_reads_no_voxels() -> None:
    """The values of leaves may be anything."""
    written = vdb.sample_grid(compression=vdb.ZIP | vdb.ACTIVE_MASK, metadata=STATISTICS)
    data = vdb.vdb_bytes([written])
    (info,) = list_grids(data[: -len(data) // 2] + bytes(len(data) // 2))
    assert info.active_voxels == 77


@pytest.mark.parametrize("has_offsets", [True, False])
def test_grids_of_one_name_have_an_index(has_offsets: bool) -> None:
    written = [
        vdb.Grid(name="density", tiles=[vdb.Tile((0, 0, 0), 8, float(k))]) if k != 1 else vdb.Grid(name="heat")
        for k in range(4)
    ]
    data = vdb.vdb_bytes(written, has_offsets=has_offsets)
    grids = list_grids(data)
    assert [(g.name, g.index) for g in grids] == [("density", 0), ("heat", 0), ("density", 1), ("density", 2)]
    assert read_grid(data, grids, find_grid(grids, "density", 2)).tile_values.tolist() == [3]
    with pytest.raises(VdbError, match="no grid 'density' with index 3, but 3 of that name"):
        find_grid(grids, "density", 3)
    with pytest.raises(VdbError, match="no grid 'densitty'; did you mean density"):
        find_grid(grids, "densitty")
    with pytest.raises(VdbError, match="no grid 'zzz'; its grids: 'density', 'heat'"):
        find_grid(grids, "zzz")


@pytest.mark.parametrize("has_offsets", [True, False])
def test_instances_share_a_tree_and_have_their_own_transform(has_offsets: bool) -> None:
    first = vdb.sample_grid()
    moved = vdb.Grid(name="moved", parent="density", transform=("TranslationMap", (1, 2, 3)))
    data = vdb.vdb_bytes([first, moved, vdb.Grid(name="last")], has_offsets=has_offsets)
    grids = list_grids(data)
    own, shared = read_grid(data, grids, grids[0]), read_grid(data, grids, grids[1])
    assert np.array_equal(own.leaf_values, shared.leaf_values)
    assert shared.field_from_index[:3, 3].tolist() == [1, 2, 3]
    assert grids[1].active_voxels == grids[0].active_voxels == shared.active_voxels
    assert [g.name for g in grids] == ["density", "moved", "last"]


def test_an_instance_of_nothing() -> None:
    data = vdb.vdb_bytes([vdb.Grid(name="moved", parent="density")])
    grids = list_grids(data)
    with pytest.raises(VdbError, match="grid 'moved': it shares the tree of 'density', which the file does not have"):
        read_grid(data, grids, grids[0])


@pytest.mark.parametrize("version", [222, 223, 224, 225])
def test_versions_that_are_read(version: int) -> None:
    data = vdb.vdb_bytes([vdb.Grid(leaves=ONE_LEAF)], version=version)
    grids = list_grids(data)
    assert read_grid(data, grids, grids[0]).leaf_values.tolist() == [[2.0] * 512]


@pytest.mark.parametrize(("version", "which"), [(221, "older"), (226, "newer"), (0xFFFFFFFF, "newer")])
def test_other_versions_are_refused(version: int, which: str) -> None:
    with pytest.raises(UnsupportedVdbError, match=f"the file: its format {version} is {which} than"):
        list_grids(vdb.vdb_bytes([], version=version))


@pytest.mark.parametrize("data", [b"", b" BDV", b"not a file of volumes at all", b"\0" * 100])
def test_other_files_are_refused(data: bytes) -> None:
    with pytest.raises(VdbError, match="the file: it is not an OpenVDB file"):
        list_grids(data)


def test_halves_are_those_of_the_metadata_not_of_the_type() -> None:
    """OpenVDB reads by the metadata alone."""
    written = vdb.Grid(leaves=ONE_LEAF, tree_type="Tree_float_5_4_3_HalfFloat")
    data = vdb.vdb_bytes([written])
    grids = list_grids(data)
    assert not grids[0].is_half
    assert read_grid(data, grids, grids[0]).leaf_values.dtype == np.float32


@pytest.mark.parametrize(
    ("tree_type", "reason"),
    [
        ("Tree_ptdataidx32_5_4_3", "it holds points, not voxels (Tree_ptdataidx32_5_4_3)"),
        ("Tree_string_5_4_3", "its type is not supported (Tree_string_5_4_3)"),
        ("Tree_float_4_3", "its type is not supported (Tree_float_4_3)"),
    ],
)
def test_types_that_are_refused(tree_type: str, reason: str) -> None:
    written = [vdb.Grid(name="other", tree_type=tree_type), vdb.Grid(leaves=ONE_LEAF)]
    data = vdb.vdb_bytes(written)
    grids = list_grids(data)
    assert [grid.refusal for grid in grids] == [reason, ""]
    assert (grids[0].bounds, grids[0].active_voxels) == (None, None)
    with pytest.raises(UnsupportedVdbError) as caught:
        read_grid(data, grids, grids[0])
    assert str(caught.value) == f"grid 'other': {reason}"
    assert read_grid(data, grids, grids[1]).active_voxels == 512
    with pytest.raises(UnsupportedVdbError, match="what follows it in a file without positions cannot be found"):
        list_grids(vdb.vdb_bytes(written, has_offsets=False))


def test_unknown_compression_is_refused() -> None:
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid(compression=8)]))
    assert info.refusal == "its values are compressed in an unknown way (flags 0x8)"


def test_positions_must_be_in_the_file_and_in_order() -> None:
    data = vdb.vdb_bytes([vdb.Grid()])
    at = data.index(b"Tree_float_5_4_3") + len("Tree_float_5_4_3") + 4
    for position in ((0, 0, len(data)), (at, 0, len(data)), (len(data), 0, at + 24), (at + 24, 0, len(data) + 1), (-1, -1, -1)):
        with pytest.raises(VdbError, match="grid 'density': it is said to be from byte"):
            list_grids(data[:at] + struct.pack("<qqq", *position) + data[at + 24 :])


def test_numbers_of_grids_that_cannot_be() -> None:
    data = vdb.vdb_bytes([])
    for count in (-1, 1, 1 << 30):
        with pytest.raises(VdbError):
            list_grids(data[:-4] + struct.pack("<i", count))


def test_integers_are_rounded_to_single_precision() -> None:
    values = np.arange(512, dtype=np.int64) + (1 << 40)
    data = vdb.vdb_bytes([vdb.Grid(kind="int64", leaves={(0, 0, 0): vdb.Leaf(values, np.ones(512, bool))})])
    grids = list_grids(data)
    assert np.array_equal(read_grid(data, grids, grids[0]).leaf_values[0], values.astype(np.float32))
