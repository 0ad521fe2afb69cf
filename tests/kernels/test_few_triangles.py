"""Scenes of few triangles are traced without Embree (the core's bvh/few_triangles.hpp): the same hits, and no gaps."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.cages import cube, uniform
from tests.described import box, describe, ground, kernels, lambert, mesh, placement, rotation, scaling, translation
from tests.kernels.test_intersection import rays, triangles

from primray.description import Mesh, Placed, Prototype, Sphere

TURNED = rotation([1, 2, 3], 31)


def walls() -> list[Mesh]:
    """A turned box whose six sides are meshes of their own, which share no points by number."""
    whole = box([6, 6, 6])
    points = (whole.points.astype(float) @ TURNED[:3, :3].T).astype(np.float32)
    return [mesh(points[side], [[0, 1, 2], [3, 4, 5]]) for side in whole.triangles.reshape(6, 6)]


def described(what: str) -> Any:
    if what == "soup":
        return describe([(mesh(*triangles(60, seed=1)), np.eye(4))], [lambert(0.5)])
    if what == "walls":
        blocks = [(box([1, 2, 1.5]), translation(x, 0.5, -x) @ rotation([x, 1, 0.3], 40)) for x in (-1.5, 0.1, 1.2)]
        return describe([*((w, np.eye(4)) for w in walls()), *blocks], [lambert(0.5)])
    # Small blocks on a large ground, off its middle.
    blocks = [(box([1, 2, 1]), translation(x, 1.25, -x) @ rotation([0, 1, 0], 20 * x)) for x in range(-3, 4)]
    return describe([(ground(1e5), translation(3e4, 0, 2e4)), *blocks], [lambert(0.5)])


SCENES = ("soup", "walls", "plain")


def assert_rays_meet_what_embree_says(scene: Any, o: npt.NDArray[np.float64], d: npt.NDArray[np.float32]) -> None:
    ours, embree = (kernels().intersect(scene, o, d, embree=which) for which in (False, True))
    hit = embree["primitive"] >= 0
    assert hit.mean() > 0.2
    same = ours["primitive"] == embree["primitive"]
    # Rays through an edge may fall to either side.
    assert same.mean() > 0.999
    assert ((ours["primitive"] >= 0) == hit).mean() > 0.9997
    assert np.array_equal(ours["blocked"] == 1, ours["primitive"] >= 0)
    both = hit & same
    steep = both & (np.abs(np.sum(ours["ng"] * d, axis=1)) > 0.05)
    reach = np.maximum(embree["t"], np.abs(embree["p"]).max(axis=1))
    assert (np.abs(ours["t"][steep] - embree["t"][steep]) < 2e-5 * reach[steep]).all()
    assert (np.abs(ours["p"] - embree["p"]).max(axis=1)[steep] < 2e-5 * reach[steep]).all()
    np.testing.assert_allclose(ours["ng"][both], embree["ng"][both], atol=1e-6)


@pytest.mark.parametrize("what", SCENES)
def test_rays_meet_what_embree_says(what: str) -> None:
    scene = described(what).build()
    assert kernels().has_few_triangles(scene)
    o, d = rays(seed=2)
    if what == "plain":
        o[:, 1] = np.abs(o[:, 1]) + 0.01
    assert_rays_meet_what_embree_says(scene, o, d)


@pytest.mark.parametrize("what", SCENES)
def test_any_number_of_lanes_meets_the_same_bits(what: str) -> None:
    assert_any_lanes_meet_the_same_bits(described(what).build())


def assert_any_lanes_meet_the_same_bits(scene: Any) -> None:
    o, d = rays(seed=3)
    ways = ((1, False), (4, True), (8, True), (16, True), (16, False))
    found = [kernels().intersect(scene, o, d, lanes, packet) for lanes, packet in ways]
    hit = found[0]["primitive"] >= 0
    for other in found[1:]:
        assert np.array_equal(found[0]["blocked"], other["blocked"])
        for name, values in found[0].items():
            np.testing.assert_array_equal(values[hit], other[name][hit], err_msg=name)


def aimed_at_edges(
    meshes: list[Mesh], count: int, seed: int, within: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float32]]:
    """From within a body towards points on its edges, up to a thousandth of their length from their ends."""
    rng = np.random.default_rng(seed)
    corners = np.concatenate([m.points[m.triangles] for m in meshes]).astype(float)
    t, side = rng.integers(0, len(corners), count), rng.integers(0, 3, count)
    a, b = corners[t, side], corners[t, (side + 1) % 3]
    target = a + rng.uniform(0.001, 0.999, (count, 1)) * (b - a)
    o = rng.uniform(-within, within, (count, 3))
    d = target - o
    return o, (d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32)


def test_no_ray_passes_between_meshes_that_touch() -> None:
    meshes = walls()
    scene = describe([(w, np.eye(4)) for w in meshes], [lambert(0.5)]).build()
    assert kernels().has_few_triangles(scene)
    o, d = aimed_at_edges(meshes, 500_000, seed=4, within=1.5)
    found = kernels().intersect(scene, o, d)
    assert (found["primitive"] >= 0).all()
    assert (found["blocked"] == 1).all()


def test_no_ray_passes_where_runs_of_triangles_meet() -> None:
    """A rough body of 48 triangles, cut into several runs."""
    made = uniform(cube(), 1)
    points, faces = made["points"], made["triangles"]
    assert len(faces) == 48
    points = (
        points / np.linalg.norm(points, axis=1)[:, None] * np.random.default_rng(6).uniform(2, 3, (len(points), 1))
    ).astype(np.float32)
    body = mesh(points, faces)
    scene = describe([(body, np.eye(4))], [lambert(0.5)]).build()
    assert kernels().has_few_triangles(scene)
    o, d = aimed_at_edges([body], 500_000, seed=5, within=0.5)
    assert (kernels().intersect(scene, o, d)["primitive"] >= 0).all()


def test_what_is_not_few_or_no_triangle_is_left_to_embree() -> None:
    def few(*shapes: Any, **more: Any) -> bool:
        found: bool = kernels().has_few_triangles(describe([(s, np.eye(4)) for s in shapes], [lambert(0.5)], **more).build())
        return found

    room, cubes = box([4, 4, 4]), [placement(0, [scaling(0.1, 0.1, 0.1)])]
    assert few(room)
    assert not few(room, Sphere("/s", 0.5, 0))
    prototype = Prototype("/p", (Placed(1, np.eye(4)),))
    assert not few(room, prototypes=[prototype], prototype_shapes=[box([1, 1, 1])], placements=cubes)
    # Hundreds of triangles across each other, where boxes part nothing.
    points, index = triangles(500, seed=1)
    assert not few(mesh(points, index))
    assert few(mesh(points, index[:40]))
