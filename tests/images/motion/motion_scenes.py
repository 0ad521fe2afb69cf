"""Small scenes that move, described directly, and a float reference of how things stand at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from tests.described import Described, describe, lambert, orthographic, quad, translation

from primray.description import CameraMotion, Exposure, Mesh, MovingInstances, PointMotion, Prototype
from primray.description.placement import Placement

EVEN = Exposure(0.0, 1.0, (0.0, 1.0))
GLOW = lambert(0.0, 1.0)  # seen as 1, whatever the light
EYE = translation(0, 0, 10)


def square(half: float = 1.0, z: float = 0.0) -> Mesh:
    return quad([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])


def exposed(scene: Described, exposure: Exposure = EVEN, camera: CameraMotion | None = None) -> Described:
    return replace(scene, description=replace(scene.description, exposure=exposure, camera_motion=camera))


def moving(matrices: Sequence[Any], times: Sequence[float] = (), turns: bool = False) -> MovingInstances:
    """One instance, by its matrices at times; at the frame as at the first."""
    steps = np.array([np.asarray(m)[:3] for m in matrices], np.float64)[:, None]
    given = np.array(times or np.linspace(0, 1, len(steps)))
    return MovingInstances(given, steps, steps[0], turns)


def instanced(shape: Mesh, level: Any, resolution: tuple[int, int] = (64, 4), half: float = 4.0, **more: Any) -> Described:
    prototype = Prototype("/p", ())
    scene = describe(
        [], [GLOW], camera=orthographic(EYE, half * resolution[1] / resolution[0], resolution[0] / resolution[1]),
        resolution=resolution, prototypes=[prototype], prototype_shapes=[shape], placements=[Placement(0, (level,))], **more,
    )  # fmt: skip
    from primray.description import Placed

    placed = replace(prototype, shapes=(Placed(0, np.eye(4)),))
    return exposed(replace(scene, description=replace(scene.description, prototypes=(placed,))))


def deforming(shape: Mesh, steps: Sequence[Any], times: Sequence[float] = (), **more: Any) -> Mesh:
    points = np.array(steps, np.float32)
    given = np.array(times or np.linspace(0, 1, len(points)))
    return replace(shape, motion=PointMotion(given, points, **more))


def alone(shape: Mesh, resolution: tuple[int, int] = (64, 4), half: float = 4.0, **more: Any) -> Described:
    camera = orthographic(EYE, half * resolution[1] / resolution[0], resolution[0] / resolution[1])
    return exposed(describe([(shape, np.eye(4))], [GLOW], camera=camera, resolution=resolution, **more))


def profile(scene: Described, spp: int = 4096, **settings: Any) -> np.ndarray:
    """Coverage by column, and radiance, which must be the same here."""
    from tests.described import render

    pixels = render(scene.build(), spp, **settings).pixels()
    np.testing.assert_allclose(pixels[..., 0], pixels[..., 3], atol=1e-5)
    return pixels[..., 3].mean(axis=0)


def box_average(covered: Any, resolution: int = 64, half: float = 4.0, fine: int = 64) -> np.ndarray:
    """Means over pixels of a function of x."""
    x = (np.arange(resolution * fine) + 0.5) / (resolution * fine) * 2 * half - half
    return covered(x).reshape(resolution, fine).mean(axis=1)
