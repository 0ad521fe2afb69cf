"""Any simple polygon triangulates to its own area, in its own plane and winding, whatever its shape and place."""

from __future__ import annotations

import numpy as np
import pytest

from primray.tessellation.ear_clip import ear_clip
from primray.usd.mesh.triangulate import reversed_triangles, triangulate


def simple_polygon(rng: np.random.Generator, n: int, kind: str) -> np.ndarray:
    """(n, 2), counter-clockwise, without crossings."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    if kind == "star":
        return np.asarray(rng.uniform(0.1, 1, n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1))
    if kind == "comb":  # deep notches
        x = np.arange(n - 2, dtype=float)
        y = np.where(np.arange(n - 2) % 2 == 0, 1.0, rng.uniform(0.05, 0.2, n - 2))
        return np.concatenate([[[0, 0], [n - 3, 0]], np.stack([x, y], 1)[::-1]])
    t = np.linspace(0, 6 * np.pi, n // 2)  # a band wound up
    inner, outer = (0.2 + 0.1 * t), (0.24 + 0.1 * t)
    a = np.stack([inner * np.cos(t), inner * np.sin(t)], 1)
    b = np.stack([outer * np.cos(t), outer * np.sin(t)], 1)
    return np.concatenate([b, a[::-1]])


def signed_area(p: np.ndarray) -> float:
    x, y = p.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def into_space(rng: np.random.Generator, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The polygon in a random plane, scaled and far away; and the plane's normal."""
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    q[:, 2] = np.cross(q[:, 0], q[:, 1])
    scale = 10.0 ** rng.uniform(-3, 3)
    return scale * (p @ q[:, :2].T + rng.uniform(-1, 1, 3)), q[:, 2] * scale**2


@pytest.mark.parametrize("kind", ["star", "comb", "spiral"])
@pytest.mark.parametrize("seed", range(40))
def test_area_and_winding_are_kept(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 2 * int(rng.integers(60, 90) if kind == "spiral" else rng.integers(3, 40))
    flat = simple_polygon(rng, n, kind)
    if kind == "star" and np.diff(np.sort(np.arctan2(flat[:, 1], flat[:, 0]))).max() > np.pi - 0.1:
        pytest.skip("the origin lies outside, the polygon may cross itself")
    points, normal = into_space(rng, flat)
    made = triangulate(points, np.array([n], np.int32), np.arange(n, dtype=np.int32))
    p = points[made.points]
    double_areas = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) @ normal / (normal @ normal)
    assert (double_areas > -1e-7).all()
    assert double_areas.sum() / 2 == pytest.approx(signed_area(flat), rel=1e-6)
    assert len(made.points) == n - 2


@pytest.mark.parametrize("seed", range(20))
def test_mixed_faces_keep_their_order_and_corners(seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts = rng.integers(3, 9, 50).astype(np.int32)
    polygons = [simple_polygon(rng, int(c), "star") for c in counts]
    points = np.concatenate([np.column_stack([p + np.array([4.0 * i, 0.0]), np.zeros(len(p))]) for i, p in enumerate(polygons)])
    order = rng.permutation(len(points)).astype(np.int32)
    shuffled = np.empty_like(points)
    shuffled[order] = points
    keep = rng.uniform(size=50) < 0.8
    made = triangulate(shuffled, counts, order, keep)
    assert (order[made.corners] == made.points).all()
    assert (np.diff(made.faces) >= 0).all()
    starts = np.concatenate([[0], np.cumsum(counts)])
    assert ((made.corners >= starts[made.faces][:, None]) & (made.corners < starts[made.faces + 1][:, None])).all()
    assert set(made.faces.tolist()) <= set(np.flatnonzero(keep).tolist())
    assert np.bincount(made.faces, minlength=50)[keep].tolist() == (counts[keep] - 2).tolist()
    assert (reversed_triangles(made).points[:, [0, 2, 1]] == made.points).all()


def test_a_polygon_that_crosses_itself_still_ends() -> None:
    bow = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0], [0.5, 2, 0], [-1, 0.5, 0]], float)
    assert ear_clip(bow).shape == (4, 3)
    assert ear_clip(np.zeros((7, 3))).shape == (5, 3)


def test_collinear_vertices_make_no_slivers_and_stay_vertices() -> None:
    """A square with a vertex in the middle of each edge: every one of them is used, so that neighbours fit without gaps."""
    p = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0], [0, 2, 0], [0, 1, 0]], float)
    made = triangulate(p, np.array([8], np.int32), np.arange(8, dtype=np.int32))
    assert set(made.points.ravel().tolist()) == set(range(8))
    area = np.linalg.norm(
        np.cross(p[made.points[:, 1]] - p[made.points[:, 0]], p[made.points[:, 2]] - p[made.points[:, 0]]), axis=1
    )
    assert len(area) == 6
    assert area.sum() / 2 == pytest.approx(4)


@pytest.mark.parametrize("reflex", range(4))
def test_concave_quad_at_every_corner(reflex: int) -> None:
    dart = np.roll(np.array([[0, 0.3, 0], [1, -1, 0], [0, 1, 0], [-1, -1, 0]], float), reflex, axis=0)
    made = triangulate(dart, np.array([4], np.int32), np.arange(4, dtype=np.int32))
    p = dart[made.points]
    z = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2]
    assert (z > 0).all()
    assert z.sum() / 2 == pytest.approx(signed_area(dart[:, :2]))
