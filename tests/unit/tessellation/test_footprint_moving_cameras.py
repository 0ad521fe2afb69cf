"""Cages before a camera that moves are as fine as the nearest and longest look at them asks."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.cages import grid
from tests.described import describe, lambert, perspective, rotation, translation

from primray import core
from primray.description import (
    Camera,
    CameraMotion,
    Doubles,
    Exposure,
    MatrixInstances,
    Mesh,
    Placed,
    Placement,
    Prototype,
    SceneDescription,
    SubdivisionMesh,
)
from primray.tessellation.dice import Dicing, dice

SIZE = 256
RATE = Dicing(6.0, flatness=0.0)
HALF = 0.4


def lens(world_from_camera: Doubles, half: float = HALF) -> Camera:
    return perspective(world_from_camera, half)


def flying(t: float) -> Camera:
    """Low over the cage, from far on one side to far on the other."""
    return lens(translation(40 * t - 20, 0.3, 1.5))


def coming(t: float) -> Camera:
    return lens(translation(0.2, 0.1, 12 - 9 * t))


def panning(t: float) -> Camera:
    return lens(translation(0, 0, 4) @ rotation([0, 1, 0], 100 - 130 * t))


def zooming(t: float) -> Camera:
    return lens(translation(0, 0, 8), 0.4 - 0.3 * t)


WAYS: dict[str, tuple[Callable[[float], Camera], int]] = {
    "flying": (flying, 2), "coming": (coming, 2), "panning": (panning, 2), "many pieces": (flying, 60), "zooming": (zooming, 2),
}  # fmt: skip


def wavy() -> SubdivisionMesh:
    cage = grid(4, 4)
    return replace(cage, points=(cage.points - cage.points.mean(axis=0)).astype(np.float32))


def before(way: Callable[[float], Camera], count: int, instances: bool = False) -> SceneDescription:
    """At the frame as at the beginning."""
    if instances:
        level = MatrixInstances(np.array([translation(3.0 * k, 0, -2.0 * k)[:3] for k in range(3)]))
        made = describe([], [lambert(0.5)], camera=way(0), prototypes=[Prototype("/p", (Placed(0, np.eye(4)),))],
                        prototype_shapes=(wavy(),), placements=[Placement(0, (level,))])  # fmt: skip
    else:
        made = describe([(wavy(), np.eye(4))], [lambert(0.5)], camera=way(0))
    times = np.linspace(0, 1, count)
    motion = CameraMotion(times, tuple(way(t) for t in times.tolist()))
    return replace(made.description, resolution=(SIZE, SIZE), camera_motion=motion, exposure=Exposure(0.0, 1.0, (0.0, 1.0)))


def diced(scene: SceneDescription) -> Mesh:
    mesh = dice(core.compiled, scene, RATE, 1)[0].shapes[0]
    assert isinstance(mesh, Mesh)
    return mesh


def longest_seen(mesh: Mesh, camera: Camera) -> float:
    """Pixels of the longest edge of triangles that have a corner in the view."""
    inverse = np.linalg.inv(camera.world_from_camera)
    p = mesh.points.astype(np.float64) @ inverse[:3, :3].T + inverse[:3, 3]
    half = camera.window[1]
    inside = (p[:, 2] < 0) & (np.abs(p[:, 0]) < -half * p[:, 2]) & (np.abs(p[:, 1]) < -half * p[:, 2])
    triangles = mesh.triangles[inside[mesh.triangles].any(axis=1)]
    longest = 0.0
    for i, j in ((0, 1), (1, 2)):  # the third may be a diagonal
        a, b = p[triangles[:, i]], p[triangles[:, j]]
        steps = np.stack([np.linalg.norm(a + (b - a) * s, axis=1) for s in np.linspace(0, 1, 5)])
        edges = np.linalg.norm(b - a, axis=1) * SIZE / (2 * half) / steps.min(axis=0)
        longest = max(longest, float(np.quantile(edges, 0.9)) if len(edges) else 0.0)
    return longest


@pytest.mark.parametrize("name", WAYS)
def test_no_time_shows_longer_edges(name: str) -> None:
    way, count = WAYS[name]
    mesh = diced(before(way, count))
    seen = [longest_seen(mesh, way(t)) for t in np.linspace(0, 1, 81).tolist()]
    assert max(seen) < 1.5 * RATE.pixels
    assert max(seen) > 0.25 * RATE.pixels  # and no finer than needed
    if name != "zooming":
        still = replace(before(way, count), camera_motion=None)
        assert max(longest_seen(diced(still), way(t)) for t in np.linspace(0, 1, 81).tolist()) > 2 * RATE.pixels


@pytest.mark.parametrize("instances", [False, True])
@pytest.mark.parametrize("name", WAYS)
def test_as_many_as_the_nearest_still_has(name: str, instances: bool) -> None:
    way, count = WAYS[name]
    stills = [
        len(diced(replace(before(way, count, instances), camera=way(t), camera_motion=None)).triangles)
        for t in np.linspace(0, 1, 17).tolist()
    ]
    found = len(diced(before(way, count, instances)).triangles)
    assert max(stills) <= found <= 6 * max(stills)
    assert max(stills) > stills[0]


def test_a_camera_that_stands_while_the_shutter_is_open() -> None:
    """It counts as still: as it does where motion is given for vectors alone."""
    moved, still = before(coming, 2), replace(before(coming, 2), camera_motion=None)
    standing = replace(moved, camera_motion=CameraMotion(np.array([0.0, 1.0]), (coming(0), coming(0))))
    instant = replace(moved, exposure=Exposure(0.0, 0.0, (0.0, 1.0)))
    for a, b in itertools.pairwise([still, standing, instant]):
        np.testing.assert_array_equal(diced(a).points, diced(b).points)
