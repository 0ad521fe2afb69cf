"""A camera and a frame as JSON and back, for checkpoints: what comes back is checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..description import Camera, Frame, PixelWindow, Projection
from ..settings import MAX_RESOLUTION


def camera_as_json(camera: Camera) -> dict[str, Any]:
    values = asdict(camera)
    return values | {"world_from_camera": camera.world_from_camera.tolist(), "projection": camera.projection.value}


def camera_of(values: Mapping[str, Any]) -> Camera:
    """ValueError, KeyError or TypeError where it is none."""
    matrix = np.array(values["world_from_camera"], np.float64)
    left, right, bottom, top = map(float, values["window"])
    near, far = map(float, values["clipping_range"])
    _valid(matrix.shape == (4, 4) and right != left and top != bottom and near != far)
    return Camera(
        str(values["path"]),
        matrix,
        Projection(values["projection"]),
        (left, right, bottom, top),
        (near, far),
        float(values["lens_radius"]),
        float(values["focus_distance"]),
        float(values["exposure_scale"]),
        int(values["blades"]),
        float(values["blade_rotation_deg"]),
        tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in values["clipping_planes"]),
        (float(values["shutter"][0]), float(values["shutter"][1])),
    )


def frame_of(values: Mapping[str, Any]) -> Frame:
    """As camera_of."""
    width, height = values["resolution"]
    window = [values["pixels"][name] for name in ("x", "y", "width", "height")]
    aspect = float(values["pixel_aspect_ratio"])
    _valid(all(type(n) is int and 0 < n <= MAX_RESOLUTION for n in (width, height, *window[2:])))
    _valid(all(type(n) is int and abs(n) <= MAX_RESOLUTION for n in window[:2]) and 0 < aspect < math.inf)
    return Frame((width, height), PixelWindow(*window), aspect)


def _valid(holds: bool) -> None:
    if not holds:
        raise ValueError
