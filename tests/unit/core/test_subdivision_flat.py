"""Faces that are flat are not split, and nothing else changes: positions, normals and primvars against much finer dicing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.cages import NOWHERE, cage, cube, dice, grid, octahedron, star
from tests.unit.core.test_subdivision_adaptive import assert_closed, sphere_like

from primray.description import Doubles, Interpolation, Primvar, SubdivisionMesh
from primray.tessellation.dice import Dicing

DENSITY = 100.0  # pixels a unit
SEEN = replace(NOWHERE, density=DENSITY)


def st_of(c: SubdivisionMesh, values: Any, kind: Interpolation = Interpolation.CORNER, **more: Any) -> SubdivisionMesh:
    """With a primvar that is a function of the points, for each point or each corner."""
    rows = np.stack(values(c.points[:, 0].astype(float), c.points[:, 1].astype(float)), axis=1).astype(np.float32)
    indices = c.face_points if kind is Interpolation.CORNER else None
    return replace(c, primvars=(Primvar("st", kind, rows, indices),), **more)


def affine(x: Doubles, y: Doubles) -> tuple[Doubles, Doubles]:
    return 0.3 * x - 0.1 * y + 0.7, 0.25 * y + 0.05 * x


def turned(c: SubdivisionMesh) -> SubdivisionMesh:
    """Somewhere in space, where single precision rounds."""
    axes, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    return replace(c, points=(c.points @ axes.T * 1.7 + [11.3, -7.1, 5.7]).astype(np.float32))


def triangles(n: int, m: int) -> SubdivisionMesh:
    """Of its corners, those that two triangles share would be round."""
    return grid(n, m, triangles=True, corner_points=[0, (n + 1) * (m + 1) - 1], corner_sharpnesses=[10.0, 10.0])


def stretched(n: int, m: int, **more: Any) -> SubdivisionMesh:
    c = grid(n, m, **more)
    return replace(c, points=c.points**1.5)


PLANES = {
    "square": grid(1, 1),
    "3 x 5": grid(3, 5),
    "40 x 2": grid(40, 2),
    "triangles": triangles(3, 4),
    "stretched": stretched(4, 5),
    "bilinear": replace(stretched(3, 3), scheme="bilinear"),
    "holes": grid(4, 4, holes=[5, 10]),
    "inner crease": grid(3, 3, crease_lengths=[4], crease_points=[4, 5, 6, 7], crease_sharpnesses=[10.0]),
}


@pytest.mark.parametrize("kind", [Interpolation.CORNER, Interpolation.POINT, Interpolation.VARYING, None])
@pytest.mark.parametrize("name", PLANES)
def test_planes_are_two_triangles_a_face(name: str, kind: Interpolation | None) -> None:
    c = PLANES[name] if kind is None else st_of(PLANES[name], affine, kind)
    if name == "stretched" and kind is Interpolation.VARYING:
        pytest.skip("linear over faces that the surface does not follow linearly: not affine")
    c = turned(c)
    made, full = dice(c, Dicing(4.0), SEEN), dice(c, Dicing(4.0, flatness=0.0), SEEN)
    faces = len(c.face_counts) - (0 if c.holes is None else len(c.holes))
    assert len(made["triangles"]) == faces * (1 if c.scheme == "loop" else 2)
    assert len(full["triangles"]) > 20 * len(made["triangles"])


def test_a_seam_does_not_split_a_plane() -> None:
    c = grid(4, 3)
    left = c.points[c.face_points][:, :2] * 0.1
    right = left + np.where(np.repeat(np.arange(12) % 4 >= 2, 4)[:, None], 0.5, 0.0)
    rows, indices = np.unique(right.astype(np.float32), axis=0, return_inverse=True)
    c = replace(c, primvars=(Primvar("st", Interpolation.CORNER, rows, indices.ravel().astype(np.int32)),))
    assert len(dice(c, Dicing(4.0), SEEN)["triangles"]) == 24


@pytest.mark.parametrize("scheme", ["catmullClark", "bilinear"])
def test_cubes_with_sharp_edges_are_twelve_triangles(scheme: str) -> None:
    sharp: dict[str, Any] = {}
    if scheme == "catmullClark":
        sharp = {"crease_lengths": [5, 5] + 4 * [2], "crease_sharpnesses": 6 * [10.0]}
        sharp["crease_points"] = [0, 1, 3, 2, 0, 4, 5, 7, 6, 4, 0, 4, 1, 5, 2, 6, 3, 7]
    made = dice(turned(cube(scheme=scheme, **sharp)), Dicing(4.0), SEEN)
    assert len(made["triangles"]) == 12
    assert_closed(made["triangles"])


def test_bilinear_faces_that_are_not_planar_are_curved() -> None:
    c = replace(grid(2, 2, lambda x, y: 0.3 * x * y), scheme="bilinear")
    assert len(dice(c, Dicing(4.0), SEEN)["triangles"]) > 1000


def test_outlines_are_curved() -> None:
    """A flat disk: one boundary that only its outer faces follow."""
    n = 12
    rings = [[[r * np.cos(2 * np.pi * i / n), r * np.sin(2 * np.pi * i / n), 0] for i in range(n)] for r in (1.0, 2.0, 3.0)]
    faces = [[k * n + i, (k + 1) * n + i, (k + 1) * n + (i + 1) % n, k * n + (i + 1) % n] for k in (0, 1) for i in range(n)]
    made = dice(cage(np.concatenate([np.asarray(ring) for ring in rings]), faces), Dicing(4.0), SEEN)
    edges = np.sort(np.concatenate([made["triangles"][:, [0, 1]], made["triangles"][:, [1, 2]], made["triangles"][:, [2, 0]]]))
    every, times = np.unique(edges, axis=0, return_counts=True)
    middles = made["points"][every[times == 1]].astype(float).mean(axis=1)
    radii = np.linalg.norm(middles, axis=1)
    for r in (radii[radii > 2], radii[radii < 2]):
        assert np.ptp(r) * DENSITY < 0.6  # the outline itself, a uniform spline, varies by 0.3
    assert len(radii) > 100


def nearest(point: Doubles, corners: Doubles) -> tuple[float, Doubles]:
    """Distance to the nearest of some triangles, and (T, 3) weights that are its barycentric coordinates there, else 0."""
    a, b, c = (corners[:, k] for k in range(3))
    e, g, h = b - a, c - a, c - b

    def dot(p: Doubles, q: Doubles) -> Doubles:
        return np.asarray(np.einsum("ti,ti->t", p, q))

    def along(p: Doubles, q: Doubles) -> Doubles:
        return np.clip(dot(p, q) / np.maximum(dot(q, q), 1e-300), 0, 1)

    d = point - a
    determinant = np.maximum(dot(e, e) * dot(g, g) - dot(e, g) ** 2, 1e-300)
    x = (dot(g, g) * dot(d, e) - dot(e, g) * dot(d, g)) / determinant
    y = (dot(e, e) * dot(d, g) - dot(e, g) * dot(d, e)) / determinant
    s, t, r = along(d, e), along(d, g), along(point - b, h)
    inside = np.stack([1 - x - y, x, y], axis=1)
    ways = np.stack([inside, np.stack([1 - s, s, 0 * s], 1), np.stack([1 - t, 0 * t, t], 1), np.stack([0 * r, 1 - r, r], 1)])
    distance = np.linalg.norm(np.einsum("wtk,tki->wti", ways, corners) - point, axis=2)
    distance[0][(inside < 0).any(axis=1)] = np.inf
    way, k = np.unravel_index(np.argmin(distance), distance.shape)
    weights = np.zeros((len(corners), 3))
    weights[k] = ways[way, k]
    return float(distance[way, k]), weights


def closest(points: Doubles, corners: Doubles) -> tuple[Doubles, Any]:
    """Of each point: the triangle's barycentric coordinates where it is nearest, and which triangle that is."""
    where, which = np.zeros((len(points), 3)), np.zeros(len(points), int)
    middles = corners.mean(axis=1)
    radii = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    for i, point in enumerate(points):
        distance = np.linalg.norm(middles - point, axis=1)
        near = np.flatnonzero(distance - radii <= (distance + radii).min())
        _, weights = nearest(point, corners[near])
        k = int(np.argmax(weights.sum(axis=1)))
        where[i], which[i] = weights[k], near[k]
    return where, which


def deviation(c: SubdivisionMesh, made: dict[str, Any], count: int = 60) -> tuple[float, float, float]:
    """Against finer dicing: most pixels off, most degrees between normals, and the most that primvars are off."""
    fine = dice(c, Dicing(1.5, flatness=0.0), SEEN)
    rng = np.random.default_rng(1)
    corner = rng.choice(3 * len(fine["triangles"]), count, replace=False)
    points = fine["points"][fine["triangles"].ravel()[corner]].astype(float)
    where, which = closest(points, made["points"][made["triangles"]].astype(float))
    at = np.einsum("nk,nki->ni", where, made["points"][made["triangles"][which]].astype(float))
    off = float(np.linalg.norm(at - points, axis=1).max()) * DENSITY

    def normals(d: dict[str, Any]) -> Doubles:
        indices = d["normal_indices"] if len(d["normal_indices"]) else d["triangles"]
        return np.asarray(d["normals"][indices].astype(float))

    true = normals(fine).reshape(-1, 3)[corner]
    drawn = np.einsum("nk,nki->ni", where, normals(made)[which])
    drawn /= np.linalg.norm(drawn, axis=1)[:, None]
    angle = float(np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", true, drawn), -1, 1).min())))
    if not fine["face_varying"]:
        return off, angle, 0.0
    (fi, fv), (mi, mv) = fine["face_varying"][0], made["face_varying"][0]
    value = np.einsum("nk,nki->ni", where, mv[mi[which]].astype(float))
    return off, angle, float(np.abs(value - fv[fi.ravel()[corner]]).max())


def wavy(x: Doubles, y: Doubles) -> Doubles:
    return np.asarray(0.02 * np.sin(0.8 * x) * np.cos(0.7 * y))


CURVED = {
    "sphere": sphere_like(),
    "gently curved": grid(4, 3, wavy),
    "gently curved triangles": grid(4, 3, wavy, triangles=True),
    "five around a vertex": replace(
        star(5, "catmullClark", True, 3), points=star(5, "catmullClark", True, 3).points * np.array([1, 1, 0.05], np.float32)
    ),
    "saddle": replace(grid(2, 2, lambda x, y: 0.01 * x * y), scheme="bilinear"),
    "octahedron": octahedron(),
    "semi-sharp": sphere_like(crease_lengths=[4], crease_points=[0, 1, 2, 5], crease_sharpnesses=[2.3]),
    "boundary": grid(4, 3, wavy, interpolate_boundary="edgeOnly"),
}


@pytest.mark.parametrize("name", CURVED)
def test_curved_surfaces_stay_where_they_are(name: str) -> None:
    c = st_of(CURVED[name], lambda x, y: (0.2 * x + 0.01 * np.sin(y), 0.3 * y))
    made = dice(c, Dicing(4.0), SEEN)
    off, angle, value = deviation(c, made)
    print(f"{name}: {len(made['triangles'])} triangles, {off:.3f} pixels, {angle:.3f} degrees, {value:.2g} of st")
    assert off < 0.1
    assert angle < 0.3
    assert value < 0.1 * 0.3 / DENSITY  # 0.1 pixels by its steepest gradient


def test_primvars_are_reproduced() -> None:
    """A plane whose texture coordinates bend is split for their sake."""
    plain = grid(4, 4)
    bent = st_of(plain, lambda x, y: (0.25 * x + 0.05 * np.sin(2 * x), 0.25 * y), face_varying_interpolation="none")
    made = dice(bent, Dicing(4.0), SEEN)
    assert len(made["triangles"]) > 20 * len(dice(plain, Dicing(4.0), SEEN)["triangles"])
    assert deviation(bent, made)[2] < 0.3 * 0.35 / DENSITY
    trapezoid = cage(np.array([[0, 0, 0], [2, 0, 0], [1.5, 1, 0], [0.5, 1, 0]]), [[0, 1, 2, 3]], "bilinear")
    square = Primvar("st", Interpolation.CORNER, np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
    made = dice(replace(trapezoid, primvars=(square,)), Dicing(4.0), SEEN)
    assert len(made["triangles"]) > 100
    assert len(dice(trapezoid, Dicing(4.0), SEEN)["triangles"]) == 2


def bumpy_plate() -> SubdivisionMesh:
    """A closed, sharp-edged box of 8 x 8 x 1 squares with a bump in its top: flat faces beside curved ones."""
    seen: dict[tuple[int, int, int], int] = {}
    n, faces = 8, []

    def add(*corners: tuple[int, int, int]) -> None:
        faces.append([seen.setdefault(p, len(seen)) for p in corners])

    for i in range(n):
        for j in range(n):
            add((i, j, 1), (i + 1, j, 1), (i + 1, j + 1, 1), (i, j + 1, 1))
            add((i, j, 0), (i, j + 1, 0), (i + 1, j + 1, 0), (i + 1, j, 0))
        add((i, 0, 0), (i + 1, 0, 0), (i + 1, 0, 1), (i, 0, 1))
        add((i + 1, n, 0), (i, n, 0), (i, n, 1), (i + 1, n, 1))
        add((0, i + 1, 0), (0, i, 0), (0, i, 1), (0, i + 1, 1))
        add((n, i, 0), (n, i + 1, 0), (n, i + 1, 1), (n, i, 1))
    rim = (
        [(i, 0) for i in range(n)]
        + [(n, i) for i in range(n)]
        + [(i, n) for i in range(n, 0, -1)]
        + [(0, i) for i in range(n, 0, -1)]
    )
    creases = [seen[(*p, z)] for z in (0, 1) for p in [*rim, rim[0]]]
    uprights = [seen[(x, y, z)] for x in (0, n) for y in (0, n) for z in (0, 1)]
    points = np.array(list(seen), float)
    points[[seen[(4, 4, 1)], seen[(4, 5, 1)]], 2] += 0.7
    return cage(
        points,
        faces,
        crease_lengths=[len(rim) + 1] * 2 + [2] * 4,
        crease_points=creases + uprights,
        crease_sharpnesses=[10.0] * 6,
    )


@pytest.mark.parametrize("pixels", [4.0, 20.0, 90.0])
def test_flat_beside_curved_is_closed(pixels: float) -> None:
    c = bumpy_plate()
    made, full = dice(c, Dicing(pixels), SEEN), dice(c, Dicing(pixels, flatness=0.0), SEEN)
    assert_closed(made["triangles"])
    assert len(np.unique(made["faces"])) == len(c.face_counts)
    assert len(made["triangles"]) < 0.5 * len(full["triangles"])
    rows = {p.tobytes() for p in full["points"]}
    assert all(p.tobytes() in rows for p in made["points"])
    p = made["points"][made["triangles"]].astype(float)
    g = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    q = full["points"][full["triangles"]].astype(float)
    full_area = np.linalg.norm(np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]), axis=1).sum()
    assert np.linalg.norm(g, axis=1).sum() == pytest.approx(full_area, rel=2e-3)


@pytest.mark.parametrize("made_of", [grid, triangles])
def test_uneven_planes_do_not_fold(made_of: Any) -> None:
    """Every triangle faces up, and together they cover the square."""
    rng = np.random.default_rng(8)
    for _ in range(5):
        c = made_of(6, 6)
        points = c.points.copy()
        inside = ((points[:, :2] > 0) & (points[:, :2] < 6)).all(axis=1)
        points[inside, :2] += rng.uniform(-0.25, 0.25, (inside.sum(), 2))
        points[rng.choice(np.flatnonzero(inside)), 2] = 0.4
        made = dice(replace(c, points=points.astype(np.float32)), Dicing(4.0), SEEN)
        p = made["points"][made["triangles"]].astype(float)
        g = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        assert (g[:, 2] > 0).all()
        assert g[:, 2].sum() / 2 == pytest.approx(36, abs=1e-4)
