"""Lenses with distortion, by name, and directions to try them with."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.described import describe, ground, kernels, lambert, perspective

from primray.description import Camera, Doubles
from primray.lens.distortion import Distortion, DistortionModel

RESOLUTION = (160, 100)


K = (-0.2, 0.05, 0.002, -0.003, -0.004, 0.01, 0.002, 0.001, 0.001, -0.002, 0.0015, 0.0003)


EQUIDISTANT = Distortion(DistortionModel.ANGLE_TO_RADIUS, (1.0, 0.0, 0.0, 0.0, 0.0), 110.0)


LENSES = {
    "rational": Distortion(DistortionModel.RATIONAL, K, 90.0),
    "barrel": Distortion(DistortionModel.RATIONAL, (-0.3, 0.0, *[0.0] * 10), 90.0),
    "pincushion": Distortion(DistortionModel.RATIONAL, (0.3, 0.1, *[0.0] * 10), 90.0),
    "fisheye": Distortion(DistortionModel.ANGLE_TO_RADIUS, (1.0, 0.03, -0.01, 0.002, 0.0003)),
    "turning back": Distortion(DistortionModel.ANGLE_TO_RADIUS, (1.0, -0.1, 0.0, 0.0, 0.0)),
    "f-theta": Distortion(DistortionModel.RADIUS_TO_ANGLE, (0.0, 1.0, -0.02, 0.03, 0.001), 100.0),
}


def camera_with(distortion: Distortion | None, half: float = 1.0, matrix: Any = None, **changes: Any) -> Camera:
    aspect = RESOLUTION[0] / RESOLUTION[1]
    return perspective(np.eye(4) if matrix is None else matrix, half, aspect, distortion=distortion, **changes)


def scene_of(camera: Camera, resolution: tuple[int, int] = RESOLUTION) -> Any:
    return describe([(ground(), np.eye(4))], [lambert(0.5)], camera=camera, resolution=resolution).build()


def inverse(distortion: Distortion, film: Doubles) -> Doubles:
    found: Doubles = kernels().lens_directions(scene_of(camera_with(distortion)), np.ascontiguousarray(film, np.float64))
    return found


def film_grid(half: float = 1.2, n: int = 41) -> Doubles:
    at = np.linspace(-half, half, n)
    return np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
