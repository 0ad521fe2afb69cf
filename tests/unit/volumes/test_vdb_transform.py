"""Maps of OpenVDB as matrices for column vectors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests import vdb_writer as vdb

from primray.volumes.vdb_bytes import UnsupportedVdbError, VdbError
from primray.volumes.vdb_file import list_grids, read_grid

AFFINE = np.array([[1.0, 0.5, 0, 0], [0, 2, 0.25, 0], [0, 0, 3, 0], [7, 8, 9, 1]])  # for row vectors, as in the file
TURNED = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
MAPS: dict[str, tuple[Any, Any]] = {
    "AffineMap": (AFFINE.ravel(), AFFINE.T),
    "UnitaryMap": (TURNED.ravel(), TURNED.T),
    "ScaleMap": (vdb.scale_map(0.5, 2, 4), np.diag([0.5, 2, 4, 1])),
    "UniformScaleMap": (vdb.scale_map(0.1, 0.1, 0.1), np.diag([0.1, 0.1, 0.1, 1])),
    "TranslationMap": ((1, 2, 3), [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]),
    "ScaleTranslateMap": (
        (1, 2, 3, *vdb.scale_map(0.5, 2, 4)),
        [[0.5, 0, 0, 1], [0, 2, 0, 2], [0, 0, 4, 3], [0, 0, 0, 1]],
    ),
    "UniformScaleTranslateMap": (
        (1, 2, 3, *vdb.scale_map(2, 2, 2)),
        [[2, 0, 0, 1], [0, 2, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]],
    ),
}


@pytest.mark.parametrize("kind", MAPS)
def test_linear_maps(kind: str) -> None:
    doubles, matrix = MAPS[kind]
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid(transform=(kind, doubles))]))
    assert info.field_from_index is not None
    assert np.array_equal(info.field_from_index, matrix)
    assert info.refusal == ""


def test_frustums_are_refused_with_the_reason() -> None:
    data = vdb.vdb_bytes([frustum(), vdb.sample_grid(name="other")])
    first, second = list_grids(data)
    assert first.field_from_index is None
    assert first.refusal == "its transform is a frustum (NonlinearFrustumMap), not linear"
    with pytest.raises(UnsupportedVdbError, match="grid 'density': its transform is a frustum"):
        read_grid(data, (first, second), first)
    assert read_grid(data, (first, second), second).active_voxels > 0


def test_frustums_in_streams_are_passed_over() -> None:
    data = vdb.vdb_bytes([frustum(), vdb.sample_grid(name="other")], has_offsets=False)
    grids = list_grids(data)
    assert [(grid.name, bool(grid.refusal)) for grid in grids] == [("density", True), ("other", False)]
    assert read_grid(data, grids, grids[1]).active_voxels > 0


def frustum() -> vdb.Grid:
    box_taper_depth = np.array([0.0, 0, 0, 10, 10, 10, 0.5, 20])
    second_map = vdb.text("AffineMap") + AFFINE.tobytes()
    return vdb.sample_grid(transform=("NonlinearFrustumMap", box_taper_depth.tobytes() + second_map))


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        (np.diag([1.0, 0, 1, 1]), "singular"),
        (np.array([[1.0, 0, 0, 0], [2, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "singular"),
        (np.diag([1.0, 1, 1, 2]), "singular"),
        (np.diag([1.0, np.nan, 1, 1]), "not finite"),
        (np.diag([1.0, np.inf, 1, 1]), "not finite"),
    ],
)
def test_useless_maps_are_refused(matrix: np.ndarray, reason: str) -> None:
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid(transform=("AffineMap", matrix.ravel()))]))
    assert info.refusal == f"its transform is {reason}"


def test_tiny_voxels_are_not_singular() -> None:
    (info,) = list_grids(vdb.vdb_bytes([vdb.Grid(transform=("UniformScaleMap", vdb.scale_map(1e-9, 1e-9, 1e-9)))]))
    assert info.refusal == ""


def test_unknown_maps_are_an_error_with_the_place() -> None:
    with pytest.raises(VdbError, match="grid 'density': its transform has the unknown type 'Bent'"):
        list_grids(vdb.vdb_bytes([vdb.Grid(transform=("Bent", ()))]))
