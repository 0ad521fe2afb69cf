"""Cages whose faces are diced to different levels: closed where they are closed, the same limit points as uniform dicing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.cages import NOWHERE, cage, cube, dice, grid, octahedron, seen_from, uniform
from tests.described import core_module

from primray.description import Doubles, Interpolation, Primvar, SubdivisionMesh
from primray.tessellation.dice import Dicing, core_arrays
from primray.tessellation.footprint import Footprint


def sphere_like(**more: Any) -> SubdivisionMesh:
    """A cube's faces in 3 x 3 each: quads, vertices of valence 3 and 4."""
    seen: dict[tuple[int, int, int], int] = {}
    faces = []
    for axis in range(3):
        for side in (0, 3):
            for i in range(3):
                for j in range(3):
                    corners = []
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        p = [0, 0, 0]
                        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, i + a, j + b
                        corners.append(seen.setdefault((p[0], p[1], p[2]), len(seen)))
                    faces.append(corners if side else corners[::-1])
    return cage(np.array(list(seen)) / 1.5 - 1.0, faces, **more)


CREASED = {"crease_lengths": [5], "crease_points": [0, 1, 3, 2, 0], "crease_sharpnesses": [10.0]}
CAGES = {
    "cube": cube(),
    "creased cube": cube(**CREASED),
    "semi-sharp cube": cube(**(CREASED | {"crease_sharpnesses": [2.3]})),
    "bilinear cube": cube(scheme="bilinear"),
    "27 faces a side": sphere_like(),
    "octahedron": octahedron(),
    "creased octahedron": octahedron(crease_lengths=[3], crease_points=[0, 2, 1], crease_sharpnesses=[10.0]),
    "tetrahedron of quads": cage(
        [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    ),
}
VIEWS = {
    "near": seen_from([0, 0, 1.05], [0.3, 0.2, 0]),
    "inside": seen_from([0.1, 0.1, 0.6], [0.5, 0.2, 0.9]),
    "beside": seen_from([0.9, 0.9, 0.9], [0.9, 0.8, 0]),
}


def edges_of(triangles: Any) -> tuple[Any, Any]:
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).astype(np.int64)
    return directed, np.sort(directed, axis=1)


def assert_closed(triangles: Any) -> None:
    """Every edge belongs to two triangles, once each way."""
    directed, undirected = edges_of(triangles)
    assert (directed[:, 0] != directed[:, 1]).all()
    assert len(np.unique(directed, axis=0)) == len(directed)
    _, counts = np.unique(undirected, axis=0, return_counts=True)
    assert (counts == 2).all()


@pytest.mark.parametrize("flatness", [0.0, 0.1])
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", CAGES)
def test_closed_whatever_the_levels(name: str, view: str, flatness: float) -> None:
    made = dice(CAGES[name], Dicing(12.0, 0, 6, flatness=flatness), VIEWS[view])
    assert_closed(made["triangles"])
    assert len(np.unique(made["faces"])) == len(CAGES[name].face_counts)


@pytest.mark.parametrize("name", CAGES)
def test_levels_differ_within_a_face(name: str) -> None:
    made = dice(CAGES[name], Dicing(12.0, 0, 6, flatness=0.0), VIEWS["near"])
    finest = uniform(CAGES[name], made["level"])
    assert 0.002 < len(made["triangles"]) / len(finest["triangles"]) < 0.9


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", CAGES)
def test_points_are_those_of_uniform_dicing(name: str, view: str) -> None:
    """Bit for bit: every vertex is one of the uniformly diced cage's, with its normal."""
    made = dice(CAGES[name], Dicing(12.0, 0, 6), VIEWS[view])
    full = uniform(CAGES[name], made["level"])
    rows = {p.tobytes() for p in full["points"]}
    assert all(p.tobytes() in rows for p in made["points"])
    if len(made["normal_indices"]) == 0:
        both = {p.tobytes() + n.tobytes() for p, n in zip(full["points"], full["normals"], strict=True)}
        assert all(p.tobytes() + n.tobytes() in both for p, n in zip(made["points"], made["normals"], strict=True))


@pytest.mark.parametrize("name", CAGES)
def test_normals_face_outwards(name: str) -> None:
    """Every corner's normal is on the outside of its triangle, and close to it where that is fine."""
    made = dice(CAGES[name], Dicing(6.0, 2, 7), VIEWS["beside"])
    by_corner = len(made["normal_indices"]) > 0
    n = made["normals"][made["normal_indices"] if by_corner else made["triangles"]].astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(n, axis=2), 1, atol=1e-5)
    p = made["points"][made["triangles"]].astype(np.float64)
    g = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    size = np.linalg.norm(g, axis=1)
    cosine = np.einsum("tki,ti->tk", n, g / size[:, None])
    assert cosine.min() > 0.5
    assert np.average(cosine.min(axis=1), weights=size) > 0.99


def test_edges_keep_to_the_pixels() -> None:
    """In view and in front, no edge is longer than asked for, and not far shorter either."""
    c = grid(3, 3, lambda x, y: np.sin(2 * x) * np.cos(3 * y))
    view = seen_from([1.5, 1.5, 4], [1.5, 1.5, 0], half=0.4)
    made = dice(c, Dicing(8.0), view)
    q = made["points"].astype(np.float64) @ view.views[0][:, :3].T + view.views[0][:, 3]
    a, b = (q[made["triangles"][:, k]] for k in (0, 1))
    pixels = np.linalg.norm(a - b, axis=1) / np.minimum(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)) * 500
    assert pixels.max() < 16  # diagonals, of sheared quads too
    assert np.median(pixels) > 2.5


def parallel(eye: list[float], target: list[float], half: float) -> Footprint:
    """Seen by an orthographic camera."""
    view = seen_from(eye, target, half=half)
    return replace(view, projected=replace(view.projected, orthographic=True))


@pytest.mark.parametrize("half", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("make", [seen_from, parallel])
@pytest.mark.parametrize("target", [[0, 0, 0], [0.4, 0.1, 0]])
def test_a_close_look_leaves_the_rest_coarse(make: Any, half: float, target: list[float]) -> None:
    """Through a long lens, triangles are small around the view only: their number grows with its logarithm."""
    made = dice(cube(), Dicing(4.0, flatness=0.0), make([target[0], target[1], 10.0], target, half=half))
    assert len(made["triangles"]) < 400_000
    assert_closed(made["triangles"])
    p = made["points"].astype(np.float64)
    a, b = (p[made["triangles"][:, k]] for k in (0, 1))
    seen = (np.hypot(a[:, 0] - target[0], a[:, 1] - target[1]) < 1e-3) & (a[:, 2] > 0)
    assert np.linalg.norm(a - b, axis=1)[seen].max() < max(2 * half * (10 if make is seen_from else 1) / 50, 2 / 1000)


def test_primvars_agree_with_uniform_dicing() -> None:
    c = cube()
    rng = np.random.default_rng(4)
    values = rng.random((12, 2)).astype(np.float32)
    indices = rng.integers(0, 12, 24).astype(np.int32)
    primvars = (
        Primvar("st", Interpolation.CORNER, values, indices),
        Primvar("smooth", Interpolation.POINT, rng.random((8, 1)).astype(np.float32)),
        Primvar("linear", Interpolation.VARYING, rng.random((8, 1)).astype(np.float32)),
    )
    c = cube(primvars=primvars, face_varying_interpolation="none")
    made, full = dice(c, Dicing(12.0, 0, 6), VIEWS["near"]), uniform(c, 6)

    def rows(d: dict[str, Any]) -> Doubles:
        st = d["face_varying"][0][1][d["face_varying"][0][0].ravel()]
        at = d["triangles"].ravel()
        face = np.repeat(d["faces"], 3)[:, None]
        return np.concatenate([d["points"][at], face, st, d["vertex_values"][at], d["varying_values"][at]], axis=1)

    known = {r.tobytes() for r in rows(full).astype(np.float32)}
    assert all(r.tobytes() in known for r in rows(made).astype(np.float32))


@pytest.mark.parametrize("rule", ["none", "edgeOnly", "edgeAndCorner"])
@pytest.mark.conforms("Mesh.interpolateBoundary")
def test_boundary_rules(rule: str) -> None:
    made = uniform(grid(4, 4, interpolate_boundary=rule), 2)
    low, high = made["points"][:, 0].min(), made["points"][:, 0].max()
    if rule == "none":  # the faces at the boundary only shape the others
        assert set(made["faces"].tolist()) == {5, 6, 9, 10}
        np.testing.assert_allclose([low, high], [1, 3], atol=1e-6)
    else:
        assert len(np.unique(made["faces"])) == 16
        np.testing.assert_allclose([low, high], [0, 4] if rule == "edgeAndCorner" else [low, 4 - low], atol=1e-6)
    tip = np.abs(made["points"][:, :2]).sum(axis=1).min()
    assert (tip < 1e-6) == (rule == "edgeAndCorner")


@pytest.mark.conforms("Mesh.holeIndices")
def test_holes_shape_but_are_not_drawn() -> None:
    whole, holed = uniform(cube(), 3), uniform(cube(holes=[0]), 3)
    assert set(holed["faces"].tolist()) == {1, 2, 3, 4, 5}
    rows = {p.tobytes() for p in whole["points"]}
    assert all(p.tobytes() in rows for p in holed["points"])


def test_limit_on_triangles() -> None:
    assert core_module().dice(core_arrays(cube(), NOWHERE, Dicing(1.0, 5, 5, 1000))) is None


BROKEN = {
    "fins": [[0, 1, 3, 2], [1, 0, 4, 5], [0, 1, 7, 6]],
    "turned": [[0, 1, 3, 2], [4, 5, 1, 0][::-1], [0, 4, 6, 2]],
    "touching": [[0, 1, 3, 2], [2, 5, 6, 7]],
    "twice": [[0, 1, 3, 2], [0, 1, 3, 2]],
    "back and front": [[0, 1, 3, 2], [2, 3, 1, 0]],
    "polygon": [[0, 1, 3, 2, 6, 7, 5]],
    "two neighbours twice": [[0, 1, 2, 3], [2, 1, 0, 4]],
}


@pytest.mark.parametrize("scheme", ["catmullClark", "loop", "bilinear"])
@pytest.mark.parametrize("name", BROKEN)
def test_broken_cages_give_finite_triangles(name: str, scheme: str) -> None:
    faces = BROKEN[name]
    if scheme == "loop":
        faces = [[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)]
    points = np.random.default_rng(2).normal(size=(9, 3))
    for creases in ({}, {"crease_lengths": [3], "crease_points": [0, 1, 3], "crease_sharpnesses": [1.5]}):
        c = cage(points, faces, scheme, **creases)
        for made in (uniform(c, 0), uniform(c, 3), dice(c, Dicing(20.0, 0, 5), VIEWS["near"])):
            assert np.isfinite(made["points"]).all()
            assert np.isfinite(made["normals"]).all()
            assert 0 <= made["triangles"].min() <= made["triangles"].max() < len(made["points"])
            assert set(made["faces"].tolist()) == set(range(len(faces)))
            if len(made["normal_indices"]):
                assert made["normal_indices"].min() >= 0


def test_random_cages_do_not_crash() -> None:
    """Any faces over few points: everything that is not a surface occurs."""
    rng = np.random.default_rng(7)
    for trial in range(150):
        sizes = rng.integers(3, 6, rng.integers(1, 12))
        faces = [rng.choice(8, size, replace=False).tolist() for size in sizes]
        scheme = ("catmullClark", "loop", "bilinear")[trial % 3]
        if scheme == "loop":
            faces = [f[:3] for f in faces]
        corners = sum(map(len, faces))
        c = cage(
            rng.normal(size=(8, 3)),
            faces,
            scheme,
            holes=[0] if trial % 5 == 0 else [],
            crease_lengths=[3],
            crease_points=rng.choice(8, 3, replace=False),
            crease_sharpnesses=rng.uniform(0, 12, 1),
            corner_points=[1],
            corner_sharpnesses=rng.uniform(0, 12, 1),
            interpolate_boundary=("none", "edgeOnly", "edgeAndCorner")[trial % 7 % 3],
            primvars=(
                Primvar(
                    "st",
                    Interpolation.CORNER,
                    rng.random((5, 2)).astype(np.float32),
                    rng.integers(0, 5, corners).astype(np.int32),
                ),
            ),
            face_varying_interpolation=("none", "cornersPlus1", "cornersPlus2", "boundaries")[trial % 4],
        )
        made = dice(c, Dicing(30.0, 0, 4), VIEWS["near"])
        for name in ("points", "normals"):
            assert np.isfinite(made[name]).all()
        indices, values = made["face_varying"][0]
        assert len(indices) == 0 or (indices.min() >= 0 and indices.max() < len(values))
        assert np.isfinite(values).all()
