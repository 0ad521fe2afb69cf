"""Test whether a camera may see light where nothing covers the picture; if so, display views of it are written without alpha.

Light without coverage cannot be represented in a PNG, whose alpha is straight. The answer follows from lights and camera alone,
so that samples never decide which channels a file has.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Doubles
from ..camera import Camera, Projection
from .lighting import Light, LightType, half_extent
from .scene import SceneDescription


def is_lit_behind(description: SceneDescription) -> bool:
    """Return whether a dome, or the extent of another light visible to the camera, is in the frame."""
    return any(_may_be_seen(light, description.camera) for light in description.lights)


def _may_be_seen(light: Light, camera: Camera) -> bool:
    if not light.visible_to_camera or not any(light.emission):
        return False
    if light.type is LightType.DOME:
        return True
    if light.type in (LightType.POINT, LightType.LINE) or (light.type is LightType.DISTANT and light.angle_deg <= 0):
        return False
    if camera.distortion is not None:
        return True
    return _may_be_in_frame(_corners(light, camera), camera)


def _corners(light: Light, camera: Camera) -> Doubles:
    """Return the corners (8, 3) of a box around the light, in world space."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    m = np.asarray(light.world_from_light, np.float64)
    if light.type is LightType.DISTANT:
        eye, z = camera.world_from_camera[:3, 3], m[:3, 2] / np.linalg.norm(m[:3, 2])
        half = math.tan(math.radians(min(light.angle_deg / 2, 89.0)))
        distance = 1e6
        return np.asarray(eye + distance * (z + half * signs), np.float64)
    return np.asarray((signs * half_extent(light)) @ m[:3, :3].T + m[:3, 3], np.float64)


def _may_be_in_frame(corners: Doubles, camera: Camera) -> bool:
    """Return whether the corners are not all on the outer side of one plane of the view frustum."""
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    x, y, z = (corners @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]).T
    left, right, bottom, top = camera.window
    width = -z if camera.projection is Projection.PERSPECTIVE else np.ones_like(z)
    outside = (z >= 0, x < left * width, x > right * width, y < bottom * width, y > top * width)
    return not any(bool(np.all(plane)) for plane in outside)
