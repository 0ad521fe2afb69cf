"""Bits of scenes that move do not depend on lanes, threads or the order of samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    Described,
    box,
    describe,
    ground,
    lambert,
    light,
    look_at,
    perspective,
    render,
    rotation,
    translation,
)
from tests.images.motion.motion_scenes import deforming, exposed, moving

from primray.description import (
    CameraMotion,
    LightType,
    MatrixInstances,
    MatrixMotion,
    Mesh,
    Placed,
    Prototype,
    Sphere,
)
from primray.description.placement import Placement

CAMERA = perspective(look_at([0, 3, 9], [0, 0.5, 0]), 0.4, 1.5)
SURFACES = [lambert(0.6), lambert(0.2, 2.0)]


def scene(**changes: object) -> Described:
    """Instances that turn and that shift, a mesh that deforms, spheres, a light that swings, a camera that travels."""
    cube = box([1, 1, 1])
    wave = ground(3.0)
    wave = deforming(wave, [wave.points, wave.points + [[0, 0.5, 0], [0, 0, 0], [0, 0.2, 0], [0, 0, 0]]], [0.0, 1.0])
    bent = deforming(cube, [cube.points, cube.points * 0.7, cube.points * [1, 2, 1]], [0, 0.3, 1])
    glow = replace(box([0.6, 0.1, 0.6], 1), path="/glow")
    spin = [translation(-2, 1, 0) @ rotation([1, 1, 0], a) for a in (0, 80, 160)]
    lamp = translation(1, 4, 2) @ rotation([1, 0, 0], -90)
    swing = MatrixMotion(np.array([0, 0.4, 1]), np.stack([rotation([0, 0, 1], a) @ lamp for a in (0, 20, 50)]), True)
    made = describe(
        [(wave, np.eye(4)), (bent, translation(0, 1, -2))], SURFACES,
        [replace(light(LightType.RECT, lamp, 8.0, width=1.0, height=2.0), motion=swing),
         light(LightType.SPHERE, translation(-3, 3, 2), 5.0, radius=0.3)],
        CAMERA, (48, 32),
        [Prototype("/cube", (Placed(2, np.eye(4)), Placed(3, translation(0, 0.7, 0)))),
         Prototype("/glow", (Placed(4, np.eye(4)),))],
        [cube, Sphere("/s", 0.4, 0), glow],
        [Placement(0, (moving(spin, [0, 0.35, 1], turns=True),)),
         Placement(0, (MatrixInstances(translation(2, 1, 0)[None, :3]),)),
         Placement(1, (moving([translation(2.5, 2.2, 0), translation(1.5, 2.2, 1)]),))],
    )  # fmt: skip
    poses = tuple(replace(CAMERA, world_from_camera=look_at([x, 3, 9], [0, 0.5, 0])) for x in (0, 0.3, 0.4))
    return exposed(made, camera=CameraMotion(np.array([0, 0.5, 1.0]), poses))


def nested() -> Described:
    """Instances in instances, both of which move."""
    made = scene()
    d = made.description
    inner = Prototype("/pair", (), (Placement(0, (moving([translation(0, 0, 0), translation(0, 0.5, 0)]),)),
                                    Placement(0, (MatrixInstances(translation(0, 0, 1.5)[None, :3]),))))  # fmt: skip
    outer = Placement(2, (moving([rotation([0, 1, 0], a) for a in (0, 30)], turns=True),))
    return replace(made, description=replace(d, prototypes=(*d.prototypes, inner), placements=(*d.placements, outer)))


@pytest.mark.parametrize("make", [scene, nested])
def test_lanes_and_threads(make: Callable[[], Described]) -> None:
    built = make().build()
    first = render(built, 16, lanes=1)
    assert first.pixels()[..., :3].mean() > 0.05
    for lanes, threads in ((4, 1), (8, 2), (8, 5), (1, 2)):
        again = render(built, 16, lanes=lanes, threads=threads)
        np.testing.assert_array_equal(first.pixels(), again.pixels(), err_msg=f"{lanes} lanes, {threads} threads")


def test_two_passes_and_one() -> None:
    built = scene().build()
    half = render(built, 8)
    np.testing.assert_array_equal(render(built, 16, film=half.film).pixels(), render(built, 16).pixels())


def test_a_still_camera_and_scene_at_one_time() -> None:
    """A shutter that opens for an instant shows what stands then, as a scene without motion has it."""
    made = scene()
    d = made.description
    assert d.exposure is not None
    instant = exposed(made, replace(d.exposure, opens=0.0, closes=0.0), d.camera_motion)
    still_shapes = tuple(
        replace(s, points=s.motion.points[0], motion=None) if isinstance(s, Mesh) and s.motion is not None else s
        for s in d.shapes
    )
    placements = tuple(replace(p, levels=(MatrixInstances(p.levels[0].rows(0, len(p))),)) for p in d.placements)
    lights = tuple(replace(x, motion=None) for x in d.lights)
    still = replace(
        made,
        description=replace(d, shapes=still_shapes, placements=placements, lights=lights, exposure=None, camera_motion=None),
    )
    a, b = render(instant.build(), 64, splits=1).pixels(), render(still.build(), 64, splits=1).pixels()
    np.testing.assert_allclose(a.mean(axis=(0, 1)), b.mean(axis=(0, 1)), rtol=0.02)
    assert np.median(np.abs(a - b)) < 0.01
