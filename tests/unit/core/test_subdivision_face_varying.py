"""faceVaryingLinearInterpolation on small cages, at level 0: what happens to values is the limit masks alone, by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.cages import cage, cube, grid, uniform, vertices_of

from primray.description import Interpolation, Primvar, SubdivisionMesh

RULES = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")


def with_values(c: SubdivisionMesh, values: npt.ArrayLike, indices: npt.ArrayLike, rule: str) -> SubdivisionMesh:
    primvar = Primvar("st", Interpolation.CORNER, np.asarray(values, np.float32), np.asarray(indices, np.int32))
    return replace(c, primvars=(primvar,), face_varying_interpolation=rule)


def limits(c: SubdivisionMesh, vertex: int) -> list[list[float]]:
    """The values at a vertex of the cage, of all triangles around it, sorted."""
    made = uniform(c, 0)
    indices, values = made["face_varying"][0]
    at = vertices_of(c, made)[vertex]
    found = values[np.unique(indices[made["triangles"] == at])].astype(np.float64)
    return sorted(found.round(5).tolist())


def square(x: Any, y: Any) -> Any:
    return np.stack([x * x, y + x * y], axis=1)


def test_whole_grid() -> None:
    """One region over a grid: only its outline may differ. 3 x 3 faces, value (x^2, y + x y), x and y from the points."""
    c = grid(3, 3)
    x, y = c.points[:, 0], c.points[:, 1]
    for rule in RULES:
        made = with_values(c, square(x, y), c.face_points, rule)
        middle = [[1 + 1 / 3, 2.0]] if rule != "all" else [[1.0, 2.0]]  # the B-spline of x^2 is x^2 + 1/3
        np.testing.assert_allclose(limits(made, 5), middle, atol=1e-5)
        pinned = rule in ("boundaries", "all")
        np.testing.assert_allclose(limits(made, 1), [[1.0 if pinned else 1 + 1 / 3, 0]], atol=1e-5)
        # The mesh's own corner is sharp (edgeAndCorner), and values that match the vertices follow it, whatever the rule.
        np.testing.assert_allclose(limits(made, 0), [[0.0, 0.0]], atol=1e-5)


@pytest.mark.parametrize("rule", RULES)
def test_tips_where_the_mesh_has_none(rule: str) -> None:
    """edgeOnly rounds the mesh's corners; values are pinned there unless the rule is none."""
    c = grid(2, 2, interpolate_boundary="edgeOnly")
    made = with_values(c, square(c.points[:, 0], c.points[:, 1]), c.face_points, rule)
    # Between (1, 0) and (0, 1): 4/6 of the corner's own value and 1/6 of theirs.
    rounded = [[1 / 6, 1 / 6]]
    np.testing.assert_allclose(limits(made, 0), rounded if rule == "none" else [[0, 0]], atol=1e-5)


def islands(region_of_face: list[int], height: float = 0.0) -> tuple[SubdivisionMesh, npt.NDArray[np.int32], Any]:
    """A 2 x 2 grid whose faces belong to regions of values: region r has (x + 10 r, y) at a point, bent by x y."""
    c = grid(2, 2)
    points = c.face_points.reshape(-1, 4)
    x, y = c.points[:, 0], c.points[:, 1]
    values = np.concatenate([np.stack([x + 10 * r, y + x * y], axis=1) for r in range(max(region_of_face) + 1)])
    indices = np.concatenate([points[f] + 9 * r for f, r in enumerate(region_of_face)])
    return c, indices.astype(np.int32), values


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.conforms("Mesh.faceVaryingLinearInterpolation")
def test_two_regions_side_by_side(rule: str) -> None:
    """A seam along x = 1 through the middle: each side is a boundary curve there, through (1, 0), (1, 1), (1, 2)."""
    c, indices, values = islands([0, 1, 0, 1])
    found = limits(with_values(c, values, indices, rule), 4)
    np.testing.assert_allclose(found, [[1, 2], [11, 2]], atol=1e-5)  # linear along the curve: smooth and sharp agree
    bent = np.array(values)
    bent[[1, 10], 1] = 3.0  # at (1, 0), in both regions
    v = 2.0 if rule in ("boundaries", "all") else (4 * 2 + 3 + 4) / 6
    np.testing.assert_allclose(limits(with_values(c, bent, indices, rule), 4), [[1, v], [11, v]], atol=1e-5)
    # Where the seam meets the mesh's boundary every region has one face: pinned, but for rule none.
    ends = limits(with_values(c, bent, indices, rule), 1)
    if rule == "none":
        np.testing.assert_allclose(
            ends, [[(4 + 0 + 1) / 6, (4 * 3 + 0 + 2) / 6], [(4 * 11 + 12 + 11) / 6, (12 + 0 + 2) / 6]], atol=1e-5
        )
    else:
        np.testing.assert_allclose(ends, [[1, 3], [11, 3]], atol=1e-5)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.conforms("Mesh.faceVaryingLinearInterpolation")
def test_concave_corner(rule: str) -> None:
    """One face against three: the one is a corner; the three are one curve, sharp only from cornersPlus2 on."""
    c, indices, values = islands([0, 1, 1, 1])
    found = limits(with_values(c, values, indices, rule), 4)
    one = [1.0, 2.0] if rule != "none" else [(4 * 1 + 0 + 1) / 6, (4 * 2 + 1 + 0) / 6]
    smooth = [(4 * 11 + 10 + 11) / 6, (4 * 2 + 1 + 0) / 6]
    three = smooth if rule in ("none", "cornersOnly", "cornersPlus1") else [11.0, 2.0]
    np.testing.assert_allclose(found, [one, three], atol=1e-5)


@pytest.mark.parametrize("rule", RULES)
def test_junction_of_three(rule: str) -> None:
    """Two single faces and two that share a value: cornersPlus1 sharpens the two as well."""
    c, indices, values = islands([0, 1, 2, 2])
    values[2 * 9 + 4, 1] = 5.0  # so that its curve is bent
    found = limits(with_values(c, values, indices, rule), 4)
    left, right = 20 + 0.0, 20 + 2.0
    smooth = [(4 * 21 + left + right) / 6, (4 * 5 + 1 + 3) / 6]
    np.testing.assert_allclose(found[2], smooth if rule in ("none", "cornersOnly") else [21, 5], atol=1e-5)
    pinned = [[1.0, 2.0], [11.0, 2.0]]
    if rule != "none":
        np.testing.assert_allclose(found[:2], pinned, atol=1e-5)
    else:
        np.testing.assert_allclose(found[0], [(4 * 1 + 0 + 1) / 6, (4 * 2 + 1 + 0) / 6], atol=1e-5)


@pytest.mark.parametrize("rule", RULES)
def test_dart(rule: str) -> None:
    """A seam that ends in the middle: one value there, whose ends are the two sides of the seam. Sharp from cornersPlus2 on."""
    c = grid(2, 2)
    values = np.append(square(c.points[:, 0], c.points[:, 1]), [[1, 7]], axis=0)
    indices = c.face_points.copy()
    indices[np.flatnonzero(indices == 1)[1]] = 9  # (1, 0) has another value in the face on the right
    found = limits(with_values(c, values, indices, rule), 4)
    smooth = [1.0, (4 * 2 + 0 + 7) / 6]
    np.testing.assert_allclose(found, [smooth if rule in ("none", "cornersOnly", "cornersPlus1") else [1.0, 2.0]], atol=1e-5)


@pytest.mark.parametrize("rule", RULES[1:])
def test_corners_without_shared_indices(rule: str) -> None:
    """Every corner has a row of its own: all faces are islands of one face, so that values stay linear over them."""
    c = cube()
    values = np.random.default_rng(1).random((24, 2))
    made = uniform(with_values(c, values, np.arange(24), rule), 3)
    indices, out = made["face_varying"][0]
    for face in range(6):
        got = out[np.unique(indices[made["faces"] == face])]
        corners = values[4 * face : 4 * face + 4]
        distance = np.abs(got[:, None] - corners[None]).max(axis=2).min(axis=0)
        np.testing.assert_allclose(distance, 0, atol=1e-6)
        assert (got.min(axis=0) >= corners.min(axis=0) - 1e-6).all()


def test_one_region_is_by_point() -> None:
    """Without seams its numbers are the points' own."""
    c = with_values(cube(), cube().points[:, :2], cube().face_points, "cornersPlus1")
    made = uniform(c, 2)
    indices, values = made["face_varying"][0]
    np.testing.assert_array_equal(indices, made["triangles"])
    np.testing.assert_array_equal(values, made["points"][:, :2])


def test_bowtie_values_are_sharp() -> None:
    """A value in two opposite faces, which touch in the vertex only."""
    c, indices, values = islands([0, 1, 2, 0])
    for rule in RULES[2:]:
        np.testing.assert_allclose(limits(with_values(c, values, indices, rule), 4)[0], [1, 2], atol=1e-5)


def test_loop_seam() -> None:
    c = grid(2, 2, triangles=True)
    x, y = c.points[:, 0], c.points[:, 1]
    left = np.repeat(np.isin(np.arange(8), [0, 1, 4, 5]), 3)
    values = np.concatenate([np.stack([x, y * y], axis=1), np.stack([x + 10, y * y], axis=1)])
    made = with_values(c, values, np.where(left, c.face_points, c.face_points + 9), "cornersPlus1")
    np.testing.assert_allclose(limits(made, 4), [[1, (4 + 0 + 4) / 6], [11, (4 + 0 + 4) / 6]], atol=1e-5)


def test_many_primvars_at_once() -> None:
    c = cube()
    n = len(c.points)
    rng = np.random.default_rng(0)
    linear = Primvar("a", Interpolation.VARYING, rng.random((n, 2)).astype(np.float32))
    smooth = Primvar("b", Interpolation.POINT, c.points[:, :1] * 2)
    other = Primvar("c", Interpolation.POINT, c.points)
    seams = Primvar("d", Interpolation.CORNER, rng.random((24, 4)).astype(np.float32), np.arange(24, dtype=np.int32))
    made = uniform(replace(c, primvars=(linear, smooth, seams, other)), 2)
    np.testing.assert_allclose(made["vertex_values"], np.c_[made["points"][:, :1] * 2, made["points"]], atol=1e-6)
    assert made["varying_values"].shape == (len(made["points"]), 2)
    assert made["face_varying"][0][1].shape[1] == 4


def test_non_manifold_values() -> None:
    fins = cage(
        [[0, 0, 0], [0, 0, 1], [1, 0, 0], [1, 0, 1], [-1, 0, 0], [-1, 0, 1], [0, 1, 0], [0, 1, 1]],
        [[0, 1, 3, 2], [1, 0, 4, 5], [0, 1, 7, 6]],
    )
    made = uniform(with_values(fins, fins.points[:, :2], fins.face_points, "cornersPlus1"), 2)
    assert made["non_manifold_edges"] == 1
    assert np.isfinite(made["face_varying"][0][1]).all()
