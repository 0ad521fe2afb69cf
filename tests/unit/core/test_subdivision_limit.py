"""Limit positions and normals: against splines on regular grids, around single vertices the schemes' own matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.cages import Ring, cage, cube, grid, octahedron, star, uniform, vertices_of

SCHEMES = ["catmullClark", "loop"]


def cubic(x: Any, y: Any) -> Any:
    return 0.02 * (x**3 - 2 * x**2 * y + 0.7 * x * y**2 - y**3) + 0.1 * (x * y - y**2) - 0.3 * x + 1


def smoothed_cubic(x: Any, y: Any, m: Any) -> Any:
    """What a spline with second moments m makes of control points on the cubic: f + 1/2 sum m_ij f_ij (odd moments are 0)."""
    fxx = 0.02 * (6 * x - 4 * y)
    fyy = 0.02 * (1.4 * x - 6 * y) - 0.2
    fxy = 0.02 * (-4 * x + 1.4 * y) + 0.1
    return cubic(x, y) + (m[0][0] * fxx + 2 * m[0][1] * fxy + m[1][1] * fyy) / 2


def gradient(x: Any, y: Any, m: Any) -> Any:
    h = 1e-4
    gx = (smoothed_cubic(x + h, y, m) - smoothed_cubic(x - h, y, m)) / (2 * h)
    gy = (smoothed_cubic(x, y + h, m) - smoothed_cubic(x, y - h, m)) / (2 * h)
    n = np.stack([-gx, -gy, np.ones_like(gx)], axis=1)
    return n / np.linalg.norm(n, axis=1)[:, None]


# The bicubic B-spline is the convolution of four unit boxes each way (second moment 4/12); the quartic box spline, of two
# segments in each of (1, 0), (0, 1), (1, 1).
MOMENTS = {"catmullClark": [[1 / 3, 0], [0, 1 / 3]], "loop": [[1 / 3, 1 / 6], [1 / 6, 1 / 3]]}


@pytest.mark.parametrize("level", [0, 1, 3])
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.conforms("Mesh.subdivisionScheme")
def test_regular_grids_are_splines(scheme: str, level: int) -> None:
    made = uniform(grid(6, 6, cubic, triangles=scheme == "loop"), level)
    p = made["points"].astype(np.float64)
    inside = (np.abs(p[:, :2] - 3) <= 2 + 1e-6).all(axis=1)  # a face away from the boundary
    assert inside.sum() >= 25
    x, y, z = p[inside].T
    m = MOMENTS[scheme]
    np.testing.assert_allclose(z, smoothed_cubic(x, y, m), atol=1e-6)
    np.testing.assert_allclose(made["normals"][inside], gradient(x, y, m), atol=2e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_boundaries_are_cubic_splines(scheme: str) -> None:
    made = uniform(grid(6, 3, cubic, triangles=scheme == "loop", interpolate_boundary="edgeAndCorner"), 2)
    p = made["points"].astype(np.float64)
    edge = (np.abs(p[:, 1]) < 1e-7) & (p[:, 0] >= 1) & (p[:, 0] <= 5)
    assert edge.sum() == 17
    x = p[edge, 0]
    f2 = 0.02 * 6 * x
    np.testing.assert_allclose(p[edge, 2], cubic(x, 0) + f2 / 6, atol=1e-6)  # moment 1/3 along the curve
    tips = [[6, 0], [0, 3]] if scheme == "loop" else [[0, 0], [6, 0], [0, 3], [6, 3]]  # corners of one face
    corners = p[[np.argmin(np.abs(p[:, :2] - c).sum(axis=1)) for c in tips]]
    np.testing.assert_allclose(corners[:, 2], cubic(corners[:, 0], corners[:, 1]), atol=1e-6)


def eigen_normal(ring: Ring, steps: int) -> Any:
    """The tangent plane that a ring shrinks into: of its spread about its mean after many steps, to first order."""
    for _ in range(steps):
        ring.step()
    q = np.concatenate([ring.v[None], ring.e, ring.f])
    q = q - q.mean(axis=0)
    _, s, axes = np.linalg.svd(q / np.abs(q).max())
    assert s[2] < 2e-3 * s[1]
    n = axes[2]
    return n if n[2] > 0 else -n


def limit_at_0(c: Any) -> tuple[Any, Any]:
    made = uniform(c, 0)
    at = vertices_of(c, made)[0]
    return made["points"][at], made["normals"][at] if len(made["normal_indices"]) == 0 else None


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 9, 20])
def test_smooth_vertices(scheme: str, n: int) -> None:
    c = star(n, scheme, closed=True, seed=n)
    p, normal = limit_at_0(c)
    np.testing.assert_allclose(p, Ring(c, n, True, {}).limit(400), atol=1e-6)
    if n < 9:  # beyond, rings flatten too slowly to be an oracle
        np.testing.assert_allclose(normal, eigen_normal(Ring(c, n, True, {}), 24), atol=2e-3)


def left_eigenvectors(n: int, scheme: str, closed: bool) -> tuple[Any, Any]:
    """Of the matrix that takes a ring's points to those a level down, with their eigenvalues, largest first."""
    columns = []
    count = len(star(n, scheme, closed, seed=n).points)
    for k in range(count):
        unit = star(n, scheme, closed, seed=n)
        unit.points[:] = 0
        unit.points[k, 0] = 1
        ring = Ring(unit, n, closed, {})
        ring.step()
        columns.append(np.concatenate([ring.v[None], ring.e, ring.f])[:count, 0])
    values, vectors = np.linalg.eig(np.array(columns))  # of the transpose
    order = np.argsort(-values.real)
    return values.real[order], vectors.real[:, order]


def plane(t0: Any, t1: Any) -> Any:
    n = np.cross(t0, t1)
    return n / (np.linalg.norm(n) * np.sign(n[2]))


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 9, 20])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_tangents_are_left_eigenvectors(scheme: str, n: int) -> None:
    values, left = left_eigenvectors(n, scheme, closed=True)
    assert abs(values[1] - values[2]) < 1e-9
    c = star(n, scheme, closed=True, seed=n)
    t = left[:, 1:3].T @ c.points.astype(np.float64)
    np.testing.assert_allclose(limit_at_0(c)[1], plane(t[0], t[1]), atol=1e-6)


@pytest.mark.parametrize("m", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_boundary_tangents_are_left_eigenvectors(scheme: str, m: int) -> None:
    values, left = left_eigenvectors(m, scheme, closed=False)
    cosine = np.cos(np.pi / m)
    across = 3 / 8 + cosine / 4 if scheme == "loop" else (5 + cosine + np.sqrt((9 + cosine) * (1 + cosine))) / 16
    c = star(m, scheme, closed=False, seed=m, interpolate_boundary="edgeOnly")
    p = c.points.astype(np.float64)
    along = p[1] - p[m + 1]
    found = [left[:, k] @ p for k in np.flatnonzero(np.abs(values - across) < 1e-7)]
    assert found
    # Where the eigenvalue is 1/2 as well, the one along the boundary is among them, or mixed with it.
    t = max(found, key=lambda w: float(np.linalg.norm(np.cross(w, along)) / np.linalg.norm(w)))
    np.testing.assert_allclose(limit_at_0(c)[1], plane(along, t), atol=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("m", [1, 2, 3, 4, 5, 8])
def test_boundary_vertices(scheme: str, m: int) -> None:
    c = star(m, scheme, closed=False, seed=10 + m, interpolate_boundary="edgeOnly")
    p, normal = limit_at_0(c)
    spokes = c.points[1 : m + 2].astype(np.float64)
    np.testing.assert_allclose(p, (4 * c.points[0] + spokes[0] + spokes[-1]) / 6, atol=1e-6)
    along = spokes[0] - spokes[-1]
    assert abs(normal @ along) < 1e-6 * np.linalg.norm(along)
    if m > 1:
        ring = Ring(c, m, False, {})
        for _ in range(30):
            ring.step()
        inner = ring.e[1:-1] - ring.v  # lie in the tangent plane more and more
        assert np.abs(inner @ normal).max() < 0.02 * np.linalg.norm(inner, axis=1).max()
        middle = ring.e[m // 2] - ring.v
        assert np.cross(along, middle) @ normal > 0


@pytest.mark.parametrize("scheme", SCHEMES)
def test_tips(scheme: str) -> None:
    c = star(1, scheme, closed=False, seed=3)
    p, normal = limit_at_0(c)
    np.testing.assert_array_equal(p, c.points[0])
    expected = np.cross(c.points[1] - c.points[0], c.points[2] - c.points[0])
    np.testing.assert_allclose(normal, expected / np.linalg.norm(expected), atol=1e-6)


SHARP: list[dict[int, float]] = [
    {0: 10, 2: 10},  # a crease
    {0: 10},  # a dart
    {0: 10, 1: 10, 3: 10},  # a corner
    {0: 2, 2: 2},
    {0: 2.5, 2: 1.25},
    {0: 0.5},
    {0: 0.3, 2: 0.8},
    {0: 10, 2: 1.5},
    {0: 10, 2: 3.7, 3: 0.4},
]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("n", [4, 5, 6])
@pytest.mark.parametrize("sharp", SHARP, ids=str)
@pytest.mark.conforms("Mesh.creaseSharpnesses")
def test_creases(scheme: str, n: int, sharp: dict[int, float]) -> None:
    creases = [x for k in sharp for x in (0, 1 + k)]
    c = star(
        n,
        scheme,
        closed=True,
        seed=n,
        crease_lengths=[2] * len(sharp),
        crease_points=creases,
        crease_sharpnesses=list(sharp.values()),
    )
    np.testing.assert_allclose(limit_at_0(c)[0], Ring(c, n, True, sharp).limit(), atol=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("sharpness", [0.4, 1.0, 2.6, 10.0])
@pytest.mark.conforms("Mesh.cornerSharpnesses")
def test_corners(scheme: str, sharpness: float) -> None:
    c = star(5, scheme, closed=True, seed=2, corner_points=[0], corner_sharpnesses=[sharpness])
    ring = Ring(c, 5, True, {}, np.inf if sharpness >= 10 else sharpness)
    np.testing.assert_allclose(limit_at_0(c)[0], ring.limit(), atol=1e-6)


@pytest.mark.parametrize("semi", [{}, {"sharpness": 1.7}])
@pytest.mark.parametrize("make", [cube, octahedron])
def test_levels_agree(make: Any, semi: dict[str, float]) -> None:
    """A vertex has one limit: that of its control ring a level further down is the same."""
    more = (
        {"crease_lengths": [3], "crease_points": [0, 4, 5] if make is cube else [0, 2, 1], "crease_sharpnesses": [1.7]}
        if semi
        else {}
    )
    c = make(**more)
    coarse = uniform(c, 0)["points"]
    # Refined once by hand: level 1's control points are what a linear dice of them keeps.
    fine = uniform(c, 5)["points"][: len(coarse)]
    np.testing.assert_array_equal(coarse, fine)


def test_catmull_clark_cube_is_round() -> None:
    """Its limit at the cube's vertices: (9 v + 4 sum e + sum f) / 24 with n = 3."""
    made = uniform(cube(), 0)
    np.testing.assert_allclose(np.abs(made["points"]), 0.5, atol=1e-6)
    made = uniform(cube(), 4)
    assert (np.sum(made["normals"] * made["points"], axis=1) > 0.8).all()


@pytest.mark.parametrize(("rule", "edge_point"), [("smooth", 0.47 / 3), ("catmullClark", 1 / 12)])
@pytest.mark.conforms("Mesh.triangleSubdivisionRule")
def test_triangle_rules(rule: str, edge_point: float) -> None:
    """Two triangles in a sharp rim, one point raised by 1: the point between them, and its limit, by hand."""
    points = [[0, 0, 0], [2, 0, 0], [1, 2, 1], [1, -2, 0]]
    rim: dict[str, Any] = {"crease_lengths": [5], "crease_points": [1, 2, 0, 3, 1], "crease_sharpnesses": [10.0]}
    corners: dict[str, Any] = {"corner_points": [0, 1, 2, 3], "corner_sharpnesses": [10.0] * 4}
    p = uniform(cage(points, [[0, 1, 2], [1, 0, 3]], triangle_rule=rule, **rim, **corners), 1)["points"]
    middle = p[np.argmin(np.abs(p[:, :2] - [1, 0]).sum(axis=1))]
    # Around it: the edge's ends at 0, face points at 1/3 and 0, the middles of the rim's edges at 1/2, 1/2, 0, 0.
    np.testing.assert_allclose(middle[2], (16 * edge_point + 4 / 3 + 1) / 36, atol=1e-6)


def test_bilinear() -> None:
    made = uniform(cube(scheme="bilinear"), 2)
    assert np.abs(np.abs(made["points"]).max(axis=1) - 1).max() < 1e-6
    corners = made["normals"][made["normal_indices"].ravel()].reshape(-1, 3, 3)
    p = made["points"][made["triangles"]].astype(np.float64)
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    n /= np.linalg.norm(n, axis=1)[:, None]
    np.testing.assert_allclose(corners, np.repeat(n[:, None], 3, axis=1), atol=1e-6)
