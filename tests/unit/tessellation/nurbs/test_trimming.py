"""Trim curves: what they leave is as large as the closed forms say, wherever loops lie, and has no cracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from primray.description import Mesh, TrimCurve
from primray.description.geometry import TrimLoop

from .known_patches import areas, circle, diced, plane, polygon, sphere

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
OUTER = polygon(*SQUARE)
PI = np.pi


def area(mesh: Mesh) -> float:
    crossed = areas(mesh)[:, 2]
    assert (crossed >= -1e-12).all()  # nothing is folded over
    return float(crossed.sum())


def boundary(mesh: Mesh) -> int:
    """Edges that belong to one triangle alone, by places."""
    _, place = np.unique(mesh.points, axis=0, return_inverse=True)
    t = place.reshape(-1)[mesh.triangles].astype(np.int64)
    ends = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    ends = ends[ends[:, 0] != ends[:, 1]]
    _, times = np.unique(ends, axis=0, return_counts=True)
    assert times.max() <= 2
    return int(np.count_nonzero(times == 1))


@pytest.mark.parametrize(
    ("loops", "left"),
    [
        ((circle(0.5, 0.5, 0.3),), PI * 0.09),
        ((circle(0.41, 0.57, 0.17),), PI * 0.17**2),
        ((OUTER, circle(0.5, 0.5, 0.3, hole=True)), 1 - PI * 0.09),
        ((circle(0.5, 0.5, 0.3, hole=True),), 1 - PI * 0.09),  # all that lies to its left
        ((circle(0.25, 0.25, 0.2, hole=True), circle(0.7, 0.7, 0.2, hole=True)), 1 - 2 * PI * 0.04),
        ((circle(0.5, 0.5, 0.5),), PI * 0.25),  # touches all four sides
        ((circle(0.0, 0.0, 0.5),), PI * 0.25 / 4),  # goes beyond them
        ((circle(0.5, 0.5, 0.4), circle(0.5, 0.5, 0.2, hole=True)), PI * 0.12),
        (
            (OUTER, circle(0.5, 0.5, 0.4, hole=True), circle(0.5, 0.5, 0.3), circle(0.5, 0.5, 0.1, hole=True)),
            1 - PI * (0.16 - 0.09 + 0.01),
        ),
        ((circle(0.2, 0.5, 0.1), circle(0.8, 0.5, 0.1)), 2 * PI * 0.01),
        ((circle(0.503, 0.501, 0.02),), PI * 4e-4),  # two pixels wide
        ((polygon((0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)),), 0.25),  # along lines of the grid
        ((polygon((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)),), 0.5),  # through its crossings
        ((polygon((0.1, 0.1), (0.9, 0.1), (0.5, 0.11), (0.5, 0.9)),), None),  # a spike
        ((OUTER,), 1.0),
        ((polygon((-1.0, -1.0), (2.0, -1.0), (2.0, 2.0), (-1.0, 2.0)),), 1.0),
    ],
)
def test_areas(loops: tuple[TrimLoop, ...], left: float | None) -> None:
    mesh = diced(plane(*loops), pixels=1.0).mesh
    if left is None:
        corners = np.array([(0.1, 0.1), (0.9, 0.1), (0.5, 0.11), (0.5, 0.9)])
        x, y = corners.T
        left = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)
    assert area(mesh) == pytest.approx(left, abs=5e-5 * np.sqrt(left))  # a thousandth of a pixel along its edges


def test_what_is_smaller_than_a_pixel() -> None:
    assert area(diced(plane(circle(0.503, 0.501, 1e-3)), pixels=1.0).mesh) == pytest.approx(PI * 1e-6, rel=0.05)


@pytest.mark.parametrize("hole", [False, True])
def test_what_encloses_nothing_trims_nothing(hole: bool) -> None:
    found = diced(plane(OUTER, circle(0.5, 0.5, 0.0, hole=hole)))
    assert area(found.mesh) == pytest.approx(1, rel=1e-6)
    assert found.empty_loops == 1
    alone = diced(plane(circle(0.5, 0.5, 0.0)))
    assert len(alone.mesh.triangles) == 0  # what is inside it is drawn: nothing
    assert len(diced(plane(polygon((0.2, 0.2), (0.8, 0.8), (0.2, 0.2)))).mesh.triangles) == 0


def test_a_hole_outside_of_all_leaves_nothing_of_none() -> None:
    assert len(diced(plane(circle(3.0, 3.0, 0.5))).mesh.triangles) == 0


def test_a_trimmed_sphere_is_cut_exactly_and_has_no_crack() -> None:
    """The strip between two parallels; the seam where it closes stays closed."""
    patch = sphere()
    mesh = diced(replace(patch, loops=(polygon((0.0, 0.5), (4.0, 0.5), (4.0, 1.0), (0.0, 1.0)),)), pixels=2.0).mesh
    assert np.abs(np.linalg.norm(mesh.points, axis=1) - 1).max() < 3e-7
    low = -np.sqrt(0.5)
    assert mesh.points[:, 2].min() == pytest.approx(low, abs=1e-6)
    assert mesh.points[:, 2].max() == pytest.approx(0, abs=1e-6)
    total = np.linalg.norm(areas(mesh), axis=1).sum()
    assert total == pytest.approx(2 * PI * -low, rel=2e-4)  # Archimedes
    ends = boundary(mesh)
    top, bottom = (np.abs(mesh.points[:, 2] - z) < 1e-6 for z in (0.0, low))
    assert ends <= np.count_nonzero(top) + np.count_nonzero(bottom) + 4


def test_holes_in_a_sphere() -> None:
    patch = sphere()
    whole = polygon((0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0))
    mesh = diced(replace(patch, loops=(whole, circle(1.0, 1.0, 0.3, hole=True))), pixels=2.0).mesh
    assert mesh.normals is not None
    assert np.abs(mesh.normals - mesh.points).max() < 3e-7
    seen = mesh.points[np.unique(mesh.triangles)]
    assert not ((np.abs(seen[:, 0]) < 0.2) & (seen[:, 1] > 0.95)).any()


def test_curves_follow_one_another_and_close() -> None:
    """A half circle, and the straight line that nobody gave."""
    (whole,) = circle(0.5, 0.5, 0.3)
    half = TrimCurve(replace(whole.basis, high=2.0), whole.points)
    assert area(diced(plane((half,)), pixels=1.0).mesh) == pytest.approx(PI * 0.045, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_stars(seed: int) -> None:
    """Whatever the shape, what is inside and what is outside make the whole."""
    rng = np.random.default_rng(seed)
    angles = 2 * PI * np.arange(40) / 40
    radii = rng.uniform(0.1, 0.45, 40)
    corners = tuple((0.5 + r * np.cos(a), 0.5 + r * np.sin(a)) for r, a in zip(radii, angles, strict=True))
    inside, outside = (diced(plane(loop), pixels=2.0).mesh for loop in (polygon(*corners), polygon(*corners[::-1])))
    x, y = np.array(corners).T
    expected = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)
    assert area(inside) == pytest.approx(expected, rel=1e-5)
    assert area(outside) == pytest.approx(1 - expected, rel=1e-5)
