"""Cages that move are diced once for all times, each of which is as a cage of its own would be there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.cages import cube, grid
from tests.described import describe, lambert, look_at, perspective, translation

from primray import core
from primray.description import (
    Mesh,
    MovingInstances,
    Placed,
    Placement,
    PointMotion,
    Prototype,
    SceneDescription,
    SubdivisionMesh,
)
from primray.tessellation.dice import Dicing, dice

CAMERA = perspective(look_at([0, 0, 10], [0, 0, 0]), 0.2)


def scene(cage: SubdivisionMesh, where: np.ndarray | None = None) -> SceneDescription:
    stands = np.eye(4) if where is None else where
    return replace(describe([(cage, stands)], [lambert(0.5)], camera=CAMERA).description, resolution=(256, 256))


def diced(cage: SubdivisionMesh, dicing: Dicing) -> Mesh:
    mesh = dice(core.compiled, scene(cage), dicing, 1)[0].shapes[0]
    assert isinstance(mesh, Mesh)
    return mesh


def moved(cage: SubdivisionMesh, seed: int = 3) -> SubdivisionMesh:
    steps = cage.points + np.random.default_rng(seed).normal(0, 0.2, (3, *cage.points.shape)).astype(np.float32)
    return replace(cage, motion=PointMotion(np.array([0, 0.4, 1]), steps))


@pytest.mark.parametrize("make", [cube, lambda: replace(cube(), scheme="bilinear"), lambda: grid(4, 4)])
def test_every_time_is_a_cage_of_its_own(make: object) -> None:
    cage = moved(make())  # type: ignore[operator]
    uniform = Dicing(1.0, 3, 3, flatness=0.0)
    whole = diced(cage, uniform)
    assert whole.motion is not None
    assert cage.motion is not None
    for k in range(3):
        alone = diced(replace(cage, points=cage.motion.points[k], motion=None), uniform)
        np.testing.assert_array_equal(whole.motion.points[k], alone.points)
        assert whole.triangles.shape == alone.triangles.shape
        assert whole.motion.normals is not None
        assert alone.normals is not None
        if cage.scheme != "bilinear":  # whose faces are cut by their shorter diagonals
            np.testing.assert_array_equal(whole.motion.normals[k], alone.normals)


def test_edges_are_as_the_worst_time_asks() -> None:
    """A cage that comes near at one time is as fine as if it were always there."""
    near = cube().points + np.array([0, 0, 6], np.float32)
    coming = replace(cube(), motion=PointMotion(np.array([0.0, 1.0]), np.stack([cube().points, near]).astype(np.float32)))
    fine, coarse = (len(diced(c, Dicing(8.0)).triangles) for c in (replace(cube(), points=near), cube()))
    assert len(diced(coming, Dicing(8.0)).triangles) >= fine > coarse


def test_instances_that_come_near() -> None:
    def count(steps: list[np.ndarray]) -> int:
        matrices = np.array(steps)[:, None, :3]
        level = MovingInstances(np.linspace(0, 1, len(steps)), matrices, matrices[0])
        made = describe([], [lambert(0.5)], camera=CAMERA, prototypes=[Prototype("/p", (Placed(0, np.eye(4)),))],
                        prototype_shapes=(cube(),), placements=[Placement(0, (level,))])  # fmt: skip
        mesh = dice(core.compiled, replace(made.description, resolution=(256, 256)), Dicing(8.0), 1)[0].shapes[0]
        assert isinstance(mesh, Mesh)
        return len(mesh.triangles)

    far, near = translation(0, 0, 0), translation(0, 0, 6)
    assert count([far, near]) >= count([near, near]) > count([far, far])
