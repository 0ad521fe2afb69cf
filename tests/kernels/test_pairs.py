"""Triangles in pairs are met where the same triangles one by one are met."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import box, describe, kernels, lambert, mesh, placement, rotation, scaling, translation
from tests.kernels.test_intersection import rays

from primray.description import Placed, Prototype, Shape
from primray.description.geometry import is_paired

SIDE = 24


def bumps(seed: int = 1) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """A rough sheet of quads that are not flat, as pairs (a, c, d) and (a, b, c)."""
    rng = np.random.default_rng(seed)
    at = np.linspace(-2, 2, SIDE + 1)
    x, y = np.meshgrid(at, at)
    points = np.stack([x, y, 0.3 * rng.normal(size=x.shape)], axis=-1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).ravel()
    b, c, d = a + 1, a + SIDE + 2, a + SIDE + 1
    return points, np.stack([a, c, d, a, b, c], axis=1).reshape(-1, 3).astype(np.int32)


def apart(triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """The same, all first ones before the second."""
    return np.concatenate([triangles[::2], triangles[1::2]])


def scenes(what: str, triangles: npt.NDArray[np.int32]) -> object:
    points, _ = bumps()
    rng = np.random.default_rng(2)
    sheet = mesh(points, triangles, normals=rng.normal(size=points.shape), colors=rng.uniform(size=points.shape))
    turned = rotation([1, 2, 3], 30)
    # The pairs stand first in their group, wherever they are placed.
    if what == "mixed":
        return describe([(box([0.5, 3, 0.4], 1), turned), (sheet, np.eye(4))], [lambert(0.5), lambert(0.2)]).build()
    if what == "instanced":
        shapes: tuple[Shape, ...] = (box([1, 1, 3], 1), sheet)
        prototype = Prototype("/p", (Placed(1, translation(0.3, 0, 0)), Placed(2, scaling(0.4, 0.4, 0.4))))
        places = [translation(x, 0, 0.3 * x) @ turned for x in (-1.5, 0, 1.5)]
        return describe(
            [(box([0.5, 3, 0.4], 1), turned)],
            [lambert(0.5), lambert(0.2)],
            prototypes=[prototype],
            prototype_shapes=shapes,
            placements=[placement(0, places)],
        ).build()
    return describe([(sheet, np.eye(4))], [lambert(0.5)]).build()


def geometry_of_pairs(scene: object) -> int:
    """Where the world is traced without Embree, its triangles have one number."""
    return 0 if kernels().has_hierarchy(scene) else 3


@pytest.mark.parametrize("embree", [False, True])
@pytest.mark.parametrize("what", ["alone", "mixed", "instanced"])
def test_pairs_are_met_where_their_triangles_are(what: str, embree: bool) -> None:
    _, triangles = bumps()
    assert is_paired(triangles)
    assert not is_paired(apart(triangles))
    o, d = rays(seed=3)
    scene = scenes(what, triangles)
    pairs, single = (kernels().intersect(s, o, d, embree=embree) for s in (scene, scenes(what, apart(triangles))))
    hit = single["geometry"] >= 0
    assert 0.3 < hit.mean() < 0.99
    assert (hit == (pairs["geometry"] >= 0)).all()
    assert (pairs["geometry"] == geometry_of_pairs(scene)).sum() > 300
    assert set(single["geometry"][hit]) == {0}
    for name, tolerance in (("p", 2e-6), ("ng", 1e-6), ("ns", 1e-5), ("color", 1e-5), ("t", 2e-5), ("surface", 0)):
        assert np.abs(pairs[name][hit] - single[name][hit]).max() <= tolerance, name
    if what == "alone":
        order = apart(np.arange(len(triangles), dtype=np.int32)[:, None])[:, 0]
        assert np.array_equal(pairs["primitive"][hit], order[single["primitive"][hit]])
        np.testing.assert_allclose(pairs["uv"][hit], single["uv"][hit], atol=1e-6)


@pytest.mark.parametrize("what", ["alone", "instanced"])
def test_packets_and_single_rays_meet_the_same_bits(what: str) -> None:
    scene = scenes(what, bumps()[1])
    o, d = rays(seed=4)
    ways = ((1, False), (4, True), (8, True), (16, True), (16, False))
    found = [kernels().intersect(scene, o, d, lanes, packet) for lanes, packet in ways]
    hit = found[0]["geometry"] >= 0
    for other in found[1:]:
        for name, values in found[0].items():
            np.testing.assert_array_equal(values[hit], other[name][hit], err_msg=name)


@pytest.mark.parametrize("embree", [False, True])
def test_no_ray_passes_between_pairs(embree: bool) -> None:
    """Aimed at edges, of pairs and within them."""
    points, triangles = bumps()
    rng = np.random.default_rng(5)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    inside = (np.abs(points[edges][:, :, :2]) < 1.9).all(axis=(1, 2))
    edges = np.repeat(edges[inside], 8, axis=0)
    share = rng.choice([0.25, 0.5, 0.7], len(edges))[:, None]
    at = points[edges[:, 0]].astype(float) * share + points[edges[:, 1]].astype(float) * (1 - share)
    o = at + np.array([0, 0, 40.0]) + rng.normal(size=at.shape)
    d = (at - o) / np.linalg.norm(at - o, axis=1)[:, None]
    scene = scenes("alone", triangles)
    found = kernels().intersect(scene, o, d.astype(np.float32), embree=embree)
    assert (found["geometry"] == geometry_of_pairs(scene)).all()
