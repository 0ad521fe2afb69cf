"""Exact repetitions of instances are found, whatever they are given by, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description import Interpolation, MatrixInstances, PointInstances, Primvar
from primray.description.placement import IDENTITY, Instances
from primray.usd.instancing import instances
from primray.usd.instancing.instances import without_coincident

RNG = np.random.default_rng(0)
POSITIONS = RNG.integers(0, 3, (500, 3)).astype(np.float32)  # 27 places


def rows_of(level: Instances) -> np.ndarray:
    return level.rows(0, len(level)).reshape(-1, 12)


def levels() -> list[Instances]:
    scales = RNG.integers(1, 3, (500, 3)).astype(np.float32)
    turns = RNG.integers(0, 2, (500, 4)).astype(np.float16) + np.float16(0.5)
    points = PointInstances(IDENTITY, POSITIONS, turns, scales)
    return [PointInstances(IDENTITY, POSITIONS), points, MatrixInstances(rows_of(points).reshape(-1, 3, 4))]


@pytest.mark.parametrize("level", levels(), ids=["positions", "all", "matrices"])
def test_first_ones_stay(level: Instances) -> None:
    rows = rows_of(level)
    first = np.sort(np.unique(rows, axis=0, return_index=True)[1])
    # Different quaternions may be one rotation: those are not looked for.
    found = without_coincident(level)
    assert len(first) <= len(found) < len(level)
    np.testing.assert_array_equal(np.unique(rows_of(found), axis=0), rows[np.sort(first)][np.lexsort(rows[first].T[::-1])])
    if isinstance(level, MatrixInstances):
        np.testing.assert_array_equal(rows_of(found), rows[first])


def test_primvars_tell_apart() -> None:
    values = np.arange(500, dtype=np.float32)[:, None] // 250
    level = PointInstances(IDENTITY, np.zeros((500, 3), np.float32), primvars=(Primvar("c", Interpolation.INSTANCE, values),))
    found = without_coincident(level)
    assert len(found) == 2
    np.testing.assert_array_equal(found.primvars[0].values, [[0], [1]])


def test_signed_zeros_are_equal() -> None:
    positions = np.zeros((64, 3), np.float32)
    positions[::2] = -0.0
    assert len(without_coincident(PointInstances(IDENTITY, positions))) == 1


def test_equal_hashes_of_different_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instances, "_row_hashes", lambda columns: np.zeros(len(columns[0]), np.uint64))
    level = PointInstances(IDENTITY, np.arange(300, dtype=np.float32).reshape(100, 3))
    assert without_coincident(level) is level


def test_crowd_in_a_large_placement() -> None:
    """Found by its sample; without repetitions the same object comes back."""
    positions = np.arange(600_000, dtype=np.float32).reshape(200_000, 3)
    level = PointInstances(IDENTITY, positions)
    assert without_coincident(level) is level
    positions = positions.copy()
    positions[50_000:60_000] = 1.5
    assert len(without_coincident(PointInstances(IDENTITY, positions))) == 190_001
