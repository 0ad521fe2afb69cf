"""NURBS surfaces against closed forms: points and normals to float, closed where they close, poles, edges and gaps inside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from primray.arrays import Doubles
from primray.description import Direction, Interpolation, Mesh, NurbsPatch, PointMotion, Primvar
from primray.tessellation.nurbs.evaluation import bases
from primray.tessellation.nurbs.patches import Fineness, dice_patches
from primray.usd.mesh.authored import is_closed

from .known_patches import AROUND, STRAIGHT, areas, cone, diced, plane, seen, sphere, torus

FLOAT = 3e-7


def edges(mesh: Mesh) -> Doubles:
    a, b, c = (mesh.points[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    return np.asarray(np.linalg.norm(np.concatenate([b - a, c - b, a - c]), axis=1))


def test_a_sphere_is_one() -> None:
    mesh = diced(sphere()).mesh
    assert np.abs(np.linalg.norm(mesh.points, axis=1) - 1).max() < FLOAT
    assert mesh.normals is not None
    assert np.abs(mesh.normals - mesh.points).max() < FLOAT  # at its poles too
    assert is_closed(mesh.points, mesh.triangles)
    assert (np.einsum("tk,tk->t", areas(mesh), mesh.points[mesh.triangles[:, 0]]) > 0).all()  # it faces outwards


def test_a_torus_is_one() -> None:
    mesh = diced(torus(0.25)).mesh
    x, y, z = mesh.points.astype(np.float64).T
    around = np.hypot(x, y)
    assert np.abs(np.hypot(around - 1, z) - 0.25).max() < FLOAT
    assert mesh.normals is not None
    expected = np.stack([x / around * (around - 1), y / around * (around - 1), z], axis=1) / 0.25
    assert np.abs(mesh.normals - expected).max() < 2e-6  # the points' rounding over the tube's radius
    assert is_closed(mesh.points, mesh.triangles)


def test_a_cone_has_a_normal_a_line_at_its_tip() -> None:
    mesh = diced(cone()).mesh
    tip = mesh.points[:, 2] == 1
    assert np.count_nonzero(tip) > 100
    assert mesh.normals is not None
    assert np.allclose(mesh.normals[tip][:, 2], np.sqrt(0.5), atol=1e-6)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
    assert len(np.unique(mesh.normals[tip].round(3), axis=0)) > 50


@pytest.mark.parametrize("pixels", [1.0, 4.0, 16.0])
def test_edges_cover_as_many_pixels_as_asked(pixels: float) -> None:
    mesh = diced(torus(0.25), pixels, flatness=0.0).mesh
    longest = 100 * edges(mesh).max()
    assert longest <= pixels * np.sqrt(2) * 1.01  # diagonals
    assert longest >= pixels / 2.1


def test_flat_ones_are_two_triangles_and_as_large_as_they_are() -> None:
    mesh = diced(plane()).mesh
    assert len(mesh.triangles) == 2
    assert areas(mesh).sum(axis=0).tolist() == [0, 0, 1]


def test_left_handed_ones_face_the_other_way() -> None:
    mesh = diced(replace(sphere(), is_flipped=True)).mesh
    assert mesh.normals is not None
    assert np.abs(mesh.normals + mesh.points).max() < FLOAT
    assert (np.einsum("tk,tk->t", areas(mesh), mesh.points[mesh.triangles[:, 0]]) < 0).all()


def test_a_range_cuts() -> None:
    patch = sphere()
    half = diced(replace(patch, u=replace(patch.u, low=0.5, high=2.25))).mesh
    x, y, z = half.points.astype(np.float64).T
    angles = np.mod(np.degrees(np.arctan2(y, x)), 360)[np.abs(z) < 0.99]
    assert angles.min() == pytest.approx(45, abs=1e-3)  # the middle of a quarter
    assert angles.max() == pytest.approx(180 + np.degrees(np.arctan2(*quarter(0.25)[::-1])), abs=1e-3)


def quarter(t: float) -> tuple[float, float]:
    w = np.array([(1 - t) ** 2, 2 * t * (1 - t) * np.sqrt(0.5), t * t])
    x, y = (w * np.array([1, 1, 0])).sum(), (w * np.array([0, 1, 1])).sum()
    return float(x / w.sum()), float(y / w.sum())


def strip(heights: list[float], knots: list[float], order: int) -> NurbsPatch:
    """Flat along y; heights over x."""
    n = len(heights)
    points = np.array([(x, y, h) for y in (0, 1) for x, h in enumerate(heights)], np.float32)
    k = np.array(knots, float)
    return NurbsPatch("/p", points, None, Direction(n, order, k, float(k[order - 1]), float(k[n])), STRAIGHT, 0)


def test_an_edge_inside_keeps_both_sides_normals_and_no_gap() -> None:
    """A knot as often as the degree: a roof of two flat sides."""
    mesh = diced(strip([0, 1, 2, 1, 0], [0, 0, 0, 1, 1, 2, 2, 2], 3)).mesh
    assert mesh.normals is not None
    assert np.allclose(np.abs(mesh.normals[:, 0]), np.sqrt(0.5), atol=1e-6)
    ridge = np.flatnonzero(mesh.points[:, 2] == 2)
    assert len(np.unique(mesh.normals[ridge].round(5), axis=0)) == 2
    assert len(np.unique(mesh.points[ridge], axis=0)) == len(ridge) / 2
    assert np.linalg.norm(areas(mesh), axis=1).sum() == pytest.approx(4 * np.sqrt(2), rel=1e-6)


def test_a_knot_as_often_as_the_order_is_a_gap() -> None:
    mesh = diced(strip([0, 0, 0, 5, 5, 5], [0, 0, 0, 1, 1, 1, 2, 2, 2], 3)).mesh
    assert set(mesh.points[:, 2].tolist()) == {0.0, 5.0}
    assert np.linalg.norm(areas(mesh), axis=1).sum() == pytest.approx(4, rel=1e-6)  # nothing between them


def test_bases_are_those_of_the_recursion() -> None:
    """Cox and de Boor's, written as in the book, and their derivatives by differences."""
    rng = np.random.default_rng(5)
    knots = np.sort(rng.uniform(0, 1, 12))
    direction = Direction(8, 4, knots, knots[3], knots[8])

    def value(i: int, p: int, u: float) -> float:
        if p == 0:
            return float(knots[i] <= u < knots[i + 1])
        left = (u - knots[i]) / (knots[i + p] - knots[i]) * value(i, p - 1, u)
        return float(left + (knots[i + p + 1] - u) / (knots[i + p + 1] - knots[i + 1]) * value(i + 1, p - 1, u))

    for u in rng.uniform(knots[3], knots[8], 20):
        span = int(np.searchsorted(knots, u, "right")) - 1
        found = bases(direction, np.array([span]), np.array([u]))
        expected = [value(span - 3 + r, 3, u) for r in range(4)]
        assert np.allclose(found.values[0], expected, atol=1e-13)
        further = bases(direction, np.array([span]), np.array([u + 1e-6])).values[0]
        assert np.allclose(found.slopes[0], (further - found.values[0]) / 1e-6, rtol=1e-3, atol=1e-2)
        assert found.values.sum() == pytest.approx(1)


def test_clamped_and_unclamped_knots() -> None:
    """Straight lines of control points with even knots are straight in the parameter."""
    patch = strip([0, 1, 2, 3, 4, 5], list(range(10)), 4)
    mesh = diced(patch).mesh
    assert mesh.points[:, 0].min() == pytest.approx(1)  # the mean of the first three
    assert mesh.points[:, 0].max() == pytest.approx(4)
    assert np.allclose(mesh.points[:, 0], mesh.points[:, 2])


def test_values_go_with_the_surface() -> None:
    """Vertex ones by the rational basis, as points; varying ones between knots; uniform ones from knot to knot."""
    patch = sphere()
    crossings = np.array([[s, t] for t in range(3) for s in range(5)], np.float32)
    carried = replace(
        patch,
        primvars=(
            Primvar("P", Interpolation.POINT, patch.points),
            Primvar("st", Interpolation.VARYING, np.repeat(crossings, 1, axis=0)[_through_doubled()]),
            Primvar("c", Interpolation.FACE, np.arange(7 * 3, dtype=np.float32)[:, None]),
        ),
    )
    mesh = diced(carried).mesh
    points, st, faces = mesh.primvars
    assert np.abs(points.values - mesh.points).max() < FLOAT
    assert (points.interpolation, st.interpolation, faces.interpolation) == (
        Interpolation.POINT,
        Interpolation.POINT,
        Interpolation.FACE,
    )
    x, y, _ = mesh.points.T
    at_knots = np.isclose(st.values[:, 0] % 1, 0, atol=1e-7)
    assert np.abs(np.where(st.values[at_knots, 0] % 2 == 0, y[at_knots], x[at_knots])).max() < FLOAT
    assert set(faces.values[:, 0].tolist()) == {j * 7 + i for i in (0, 2, 4, 6) for j in (0, 2)}  # others are empty


def _through_doubled() -> Doubles:
    """The crossings of the knots [0 1 1 2 2 3 3 4] and [0 1 1 2] among those of different ones."""
    s, t = [0, 1, 1, 2, 2, 3, 3, 4], [0, 1, 1, 2]
    return np.array([5 * b + a for b in t for a in s])  # type: ignore[return-value]


def test_what_moves_is_as_exact_at_each_time() -> None:
    patch = sphere()
    steps = np.stack([patch.points, 2 * patch.points])
    mesh = diced(replace(patch, motion=PointMotion(np.array([0.0, 1.0]), steps)), footprint=seen(50)).mesh
    assert mesh.motion is not None
    assert np.abs(np.linalg.norm(mesh.motion.points[1], axis=1) - 2).max() < 2 * FLOAT
    assert mesh.motion.normals is not None
    assert np.abs(mesh.motion.normals[1] - mesh.points).max() < FLOAT
    still = diced(patch, footprint=seen(50)).mesh
    assert len(mesh.triangles) > 3 * len(still.triangles)  # as fine as its largest asks


def test_a_patch_that_is_a_line_or_a_point_is_nothing() -> None:
    patch = sphere()
    assert len(diced(replace(patch, points=np.zeros_like(patch.points))).mesh.triangles) == 0
    line = patch.points * np.array([0, 0, 1], np.float32)
    assert np.linalg.norm(areas(diced(replace(patch, points=line)).mesh), axis=1).sum() == 0


def test_limits() -> None:
    patches = {0: sphere(), 1: torus(0.25)}
    prints = {k: seen() for k in patches}
    made, pixels = dice_patches(patches, prints, Fineness(4.0, 0.1, 10), 10_000)
    assert pixels > 4
    assert sum(len(d.mesh.triangles) for d in made.values()) <= 10_000
    limited = diced(replace(sphere(), u=AROUND), 0.01, footprint=seen(0.5)).is_limited
    assert not limited
    assert dice_patches({0: sphere()}, prints, Fineness(0.1, 0.1, 2), 1 << 24)[0][0].is_limited
