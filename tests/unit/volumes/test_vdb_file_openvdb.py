"""Files written by OpenVDB are read voxel by voxel as it reads them, and it reads the files of tests/vdb_writer.py so.

The files in files/ are its own, made by tests/openvdb_files.py. Comparisons with the library itself take PRIMRAY_OPENVDB
(tests/openvdb_oracle.py), those of other projects' files PRIMRAY_ASSETS.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from tests import openvdb_files, openvdb_oracle
from tests import vdb_writer as vdb

from primray.volumes.vdb_file import GridInfo, list_grids, read_grid
from primray.volumes.volume_grid import VolumeGrid

FILES = Path(__file__).parent / "files"
BOX = [[-30, 10, -16], [40, 30, 8]]
PROBES = np.concatenate(
    [
        np.random.default_rng(3).integers(-4200, 8400, (300, 3)),
        [(-128, 256, 0), (-1, 383, 127), (-4096, 8192, 0), (-1, 12287, 4095), (0, 12287, 4095), (4104, 3, -4090)],
    ]
)


def read(path: Path) -> list[tuple[GridInfo, VolumeGrid]]:
    data = path.read_bytes()
    grids = list_grids(data)
    return [(info, read_grid(data, grids, info)) for info in grids]


def voxels(shape: tuple[int, ...], first: tuple[int, ...]) -> np.ndarray:
    return np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), -1).reshape(-1, 3) + first


def test_fog_in_halves_with_a_tile_and_an_instance() -> None:
    (info, fog), (other, moved) = read(FILES / "fog-half-instance.vdb")
    assert (info.name, info.index, info.grid_class, info.is_half) == ("density", 0, "fog volume", True)
    assert (other.name, other.index, other.grid_class) == ("density", 1, "fog volume")
    assert info.metadata["note"] == "written by OpenVDB"
    assert info.metadata["file_compression"] == "blosc + active values"
    own = voxels((5, 2, 2), (6, 6, 7))
    assert fog.leaf_values.dtype == np.float16
    for grid in (fog, moved):
        assert np.array_equal(grid.values_at(own), ((own @ [1, 2, 4]) / 64).astype(np.float16))
        assert grid.values_at(np.array([[32, 32, 32], [39, 39, 39], [40, 39, 39], [5, 6, 7]])).tolist() == [0.75, 0.75, 0, 0]
        assert grid.active_voxels == 5 * 2 * 2 + 8**3
    assert np.array_equal(fog.field_from_index, np.diag([0.25, 0.25, 0.25, 1]))
    assert moved.field_from_index.tolist() == [[1, 0, 0, 10], [0, 2, 0.5, 20], [0, 0, 1, 30], [0, 0, 0, 1]]
    assert fog.bounds is not None
    assert fog.bounds.tolist() == [[6, 6, 7], [39, 39, 39]]


def test_level_sets() -> None:
    ((info, ball),) = read(FILES / "level-set.vdb")
    assert (info.grid_class, ball.background) == ("level set", np.float32(0.75))
    near = voxels((5, 5, 5), (10, 10, 10))
    distance = np.linalg.norm(near * 0.5 - 6, axis=1) - 0.75
    assert np.allclose(ball.values_at(near), distance.clip(-0.75, 0.75), atol=1e-6)
    assert ball.negative > 0


def test_vectors() -> None:
    ((info, velocity),) = read(FILES / "velocity.vdb")
    assert (info.value_type, info.grid_class, velocity.background.tolist()) == ("vec3s", "staggered", [0, 0, 1])
    own = voxels((3, 3, 3), (9, 1, 2))
    assert np.array_equal(velocity.values_at(own), (own * [1, 0.5, -0.25]).astype(np.float32))
    assert velocity.field_from_index.tolist() == [[2, 0, 0, 5], [0, 3, 0, 6], [0, 0, 4, 7], [0, 0, 0, 1]]


def test_integers_and_tiles() -> None:
    ((info, counts),) = read(FILES / "counts.vdb")
    assert (info.value_type, counts.background, counts.tile_sizes.tolist(), counts.tile_values.tolist()) == (
        "int32",
        -7,
        [128],
        [5],
    )
    own = voxels((4, 4, 4), (1, 1, 1))
    assert np.array_equal(counts.values_at(own), own @ [100, 10, 1])
    assert counts.active_voxels == 64 + 128**3


def test_bools() -> None:
    ((info, marks),) = read(FILES / "marks.vdb")
    own = voxels((8, 8, 8), (0, 0, 0))
    assert info.value_type == "bool"
    assert np.array_equal(marks.values_at(own), own.sum(1) % 3 == 0)


def compare(path: Path, scratch: Path, box: list[list[int]] = BOX) -> None:
    found = openvdb_oracle.dump(path, box, PROBES, scratch)
    own = sorted(read(path), key=lambda pair: (pair[0].name, pair[0].index))
    assert len(found) == len(own)
    dense = voxels(tuple(np.subtract(box[1], box[0]).tolist()), tuple(box[0]))
    for fact, (info, grid) in zip(found, own, strict=True):
        assert (fact["name"], fact["type"], fact["count"]) == (info.name, info.value_type, grid.active_voxels)
        assert fact["count"] == info.active_voxels
        assert fact["bounds"] == (None if grid.bounds is None else grid.bounds.tolist())
        assert grid.background.reshape(-1).tolist() == fact["background"]
        for voxel, expected in ((dense, fact["dense"]), (PROBES, fact["probes"])):
            values = grid.values_at(voxel)
            assert np.array_equal(values, expected.astype(np.float32).reshape(values.shape), equal_nan=True), info.name
        corners = np.array(fact["corners"])
        matrix = np.column_stack([corners[1:].T - corners[:1].T, corners[0]])
        assert np.allclose(grid.field_from_index[:3], matrix, rtol=1e-12)


@pytest.mark.parametrize(
    "compression", [0, vdb.ACTIVE_MASK, vdb.ZIP, vdb.ZIP | vdb.ACTIVE_MASK, vdb.BLOSC, vdb.BLOSC | vdb.ACTIVE_MASK]
)
def test_openvdb_reads_what_the_writer_writes(compression: int, tmp_path: Path) -> None:
    """All types but halves as such, which OpenVDB knows since 13."""
    transforms = {"float": ("UniformScaleTranslateMap", (1, 2, 3, *vdb.scale_map(0.5, 0.5, 0.5)))}
    grids = [
        vdb.sample_grid(kind, half, compression, name=f"{kind}{half}", transform=transforms.get(kind, vdb.IDENTITY))
        for kind in vdb.TYPES
        for half in (False, True)
        if kind != "half" and (not half or kind[-1] in "tds" or kind == "double")
    ]
    path = tmp_path / "written.vdb"
    path.write_bytes(vdb.vdb_bytes(grids, version=222 + compression % 3, has_offsets=compression != vdb.ZIP))
    compare(path, tmp_path)


@pytest.mark.parametrize("path", sorted(FILES.glob("*.vdb")), ids=lambda path: path.stem)
def test_openvdb_reads_its_own_files_so(path: Path, tmp_path: Path) -> None:
    compare(path, tmp_path, [[0, 0, 0], [40, 40, 40]])


def test_the_files_are_those_that_the_script_makes(tmp_path: Path) -> None:
    openvdb_oracle.run(openvdb_files.SCRIPT, str(tmp_path))
    for path in sorted(FILES.glob("*.vdb")):
        made, kept = (list_grids(own.read_bytes()) for own in (tmp_path / path.name, path))
        assert [g.metadata for g in made] == [g.metadata for g in kept]


def test_files_of_other_projects(tmp_path: Path) -> None:
    assets = os.environ.get("PRIMRAY_ASSETS")
    if not assets:
        pytest.skip("skipped: no PRIMRAY_ASSETS")
    paths = sorted(Path(assets).rglob("*.vdb"))
    assert paths
    for path in paths:
        compare(path, tmp_path, [[0, 0, 0], [112, 224, 113]])
