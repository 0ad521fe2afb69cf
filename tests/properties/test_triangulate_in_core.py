"""The compiled core triangulates polygons as NumPy does: the same triangles in the same order, and the same faces lost."""

from __future__ import annotations

import numpy as np
import pytest
from tests.properties.test_triangulate import into_space, simple_polygon

from primray.core import compiled
from primray.usd.mesh.triangulate import triangulated

KINDS = ("star", "comb", "spiral")


def assert_same(points: np.ndarray, counts: np.ndarray, indices: np.ndarray, keep: np.ndarray | None = None) -> int:
    made = compiled.triangulate(points, counts, indices, keep)
    wanted = triangulated(points, counts, indices, keep)
    assert made is not None
    assert wanted is not None
    for found, expected in zip(made[:3], wanted[:3], strict=True):
        assert found.dtype == expected.dtype == np.int32
        np.testing.assert_array_equal(found, expected)
    assert made[3] == wanted[3]
    return int(made[3])


@pytest.mark.parametrize("seed", range(60))
def test_simple_polygons_of_any_shape(seed: int) -> None:
    """Concave ones of up to 40 vertices among convex ones and quads, some faces left out."""
    rng = np.random.default_rng(seed)
    polygons = []
    for _ in range(30):
        n = int(rng.choice([3, 4, 4, 4, 5, 6, 2 * int(rng.integers(4, 20))]))
        flat = simple_polygon(rng, n, KINDS[rng.integers(3)] if n > 7 else "star")
        polygons.append(into_space(rng, flat)[0].astype(np.float32))
    counts = np.array([len(p) for p in polygons], np.int32)
    order = rng.permutation(int(counts.sum())).astype(np.int32)
    points = np.empty((len(order), 3), np.float32)
    points[order] = np.concatenate(polygons)
    assert_same(points, counts, order)
    assert_same(points, counts, order, rng.uniform(size=len(counts)) < 0.7)


@pytest.mark.parametrize("flat", [False, True])
def test_faces_on_a_grid(flat: bool) -> None:
    """Points of a grid of three: corners in line, equal points, folded, crossing and empty faces abound."""
    rng = np.random.default_rng(int(flat))
    lost = reflex = 0
    for _ in range(3000):
        points = rng.integers(0, 3, (9, 3)).astype(np.float32)
        points[:, 2] *= not flat
        counts = rng.integers(3, 8, rng.integers(1, 5)).astype(np.int32)
        indices = rng.integers(0, 9, int(counts.sum())).astype(np.int32)
        lost += assert_same(points, counts, indices)
        made = compiled.triangulate(points, counts, indices)
        assert made is not None
        reflex += bool((np.diff(made[1], axis=1) < 0).any())
    assert lost > 100
    assert reflex > 1000


@pytest.mark.parametrize("n", [3, 4])
def test_faces_of_one_size(n: int) -> None:
    """Among them meshes of convex quads alone, whose triangles are not tested for area."""
    rng = np.random.default_rng(n)
    for trial in range(400):
        points = rng.integers(0, 4, (8, 3)).astype(np.float32)
        points[:, 2] *= trial % 2
        indices = np.concatenate([rng.permutation(8)[:n] for _ in range(1 + trial % 3)]).astype(np.int32)
        assert_same(points, np.full(1 + trial % 3, n, np.int32), indices)


def test_no_faces() -> None:
    none = np.zeros(0, np.int32)
    assert_same(np.zeros((3, 3), np.float32), none, none)
    assert_same(np.eye(3, dtype=np.float32), np.array([3], np.int32), np.arange(3, dtype=np.int32), np.zeros(1, bool))


@pytest.mark.parametrize("wrong", ["few", "below", "above", "far", "nan"])
def test_what_has_to_be_looked_at_face_by_face(wrong: str) -> None:
    points, counts = np.eye(3, dtype=np.float32), np.array([3, 3], np.int32)
    indices = np.array([0, 1, 2, 2, 1, 0], np.int32)
    assert_same(points, counts, indices)
    if wrong in ("far", "nan"):
        points[0, 0] = 1.1e37 if wrong == "far" else np.nan
    counts = np.array([4, 2], np.int32) if wrong == "few" else counts
    indices[0] = {"below": -1, "above": 3}.get(wrong, 0)
    assert compiled.triangulate(points, counts, indices) is None
    assert triangulated(points, counts, indices, None) is None
