"""What lights a stage without lights: a white dome, and a key light over the camera's left shoulder that gives things form.

White that faces the key light and sees all of the dome comes out at 1.
"""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Doubles
from ...description import Camera, Light, LightType

DOME, KEY = "primray:default-light", "primray:default-key"
RADIANCE = 0.5  # of the dome: what is behind everything
KEY_SHARE = 0.5  # of white's 1
ANGLE_DEG = 10.0  # soft shadows
TO_KEY = (-0.5, 0.7, 1.0)  # in the camera's frame: left, up, back


def default_lights(camera: Camera) -> tuple[Light, Light]:
    """For a dome of its own radiance and a distant light of a given irradiance at normal incidence."""
    # Irradiance of a distant light: pi L sin^2 of its half-angle (UsdLux, DistantLight).
    radiance = KEY_SHARE / math.sin(math.radians(ANGLE_DEG / 2)) ** 2
    dome = Light(DOME, LightType.DOME, np.eye(4), (RADIANCE,) * 3)
    return dome, Light(KEY, LightType.DISTANT, _frame(camera), (radiance,) * 3, angle_deg=ANGLE_DEG)


def _frame(camera: Camera) -> Doubles:
    """+Z towards the light."""
    z = camera.world_from_camera[:3, :3] @ (np.array(TO_KEY) / np.linalg.norm(TO_KEY))
    x = np.cross(camera.world_from_camera[:3, 1], z)
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return m
