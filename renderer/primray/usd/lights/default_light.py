"""What lights a stage without lights: a photographer's studio, painted on a dome that the camera does not see.

A large soft key light over the camera's left shoulder, a wide fill on its right, a sky above a darker ground. It is as bright
as the default view needs to show white as white, whatever the camera's exposure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles, Floats
from ...description import Camera, Light, LightType

STUDIO = "primray:default-light"
# Diffuse white that faces the key light shows so: the default view (ACES 2.0) has mid-grey at 0.18 and rolls off towards 16.
WHITE = 4.0
HEIGHT = 128  # rows of the image; softest edges a few texels wide
# Radiance relative to one another.
GROUND, HORIZON, SKY = 0.1, 0.25, 0.2
BLEND_DEG = 12.0  # of the ground into the horizon


@dataclass(frozen=True)
class Softbox:
    """A round light that fades from its inner to its outer half-angle."""

    towards: tuple[float, float, float]  # in the camera's frame: right, up, back
    radiance: float
    inner_deg: float
    outer_deg: float


SOFTBOXES = (
    Softbox((-0.5, 0.7, 1.0), 14.0, 14.0, 22.0),  # key
    Softbox((1.0, 0.15, 0.7), 0.5, 25.0, 55.0),  # fill
    Softbox((0.7, 0.6, -1.0), 4.0, 12.0, 25.0),  # rim: edges stand out from a dark background
)


def default_light(camera: Camera, z_up: bool) -> Light:
    """A dome; its radiance times the camera's exposure makes white `WHITE` where it faces the key light and sees the studio."""
    world_from_light = np.eye(4)
    if z_up:
        world_from_light[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    # Rounded, so that cameras whose matrices differ by rounding take the same samples.
    light_from_camera = np.round(world_from_light[:3, :3].T @ camera.world_from_camera[:3, :3], 9)
    scale = camera.exposure_scale if 0 < camera.exposure_scale < math.inf else 1.0
    radiance = (WHITE / scale,) * 3
    return Light(STUDIO, LightType.DOME, world_from_light, radiance, image=_painted(light_from_camera), visible_to_camera=False)


def _painted(light_from_camera: Doubles) -> Floats:
    """(HEIGHT, 2 HEIGHT, 3): lat-long as a dome's image lies, its greatest irradiance pi."""
    polar = (np.arange(HEIGHT) + 0.5) * (math.pi / HEIGHT)  # from +Y, which the first row is at
    around = (0.5 - (np.arange(2 * HEIGHT) + 0.5) / (2 * HEIGHT)) * 2 * math.pi  # s = 0.5 - atan2(x, z) / 2 pi
    up = np.broadcast_to(np.cos(polar)[:, None], (HEIGHT, 2 * HEIGHT))
    level = np.sin(polar)[:, None]
    directions = np.stack([level * np.sin(around), up, level * np.cos(around)], axis=-1)
    painted = _surroundings(directions[..., 1])
    for box in SOFTBOXES:
        painted = painted + box.radiance * _within(box, directions @ _axis(box, light_from_camera))
    solid_angles = level * (math.pi / HEIGHT) ** 2
    facing_key = np.clip(directions @ _axis(SOFTBOXES[0], light_from_camera), 0, None)
    painted *= math.pi / float((painted * facing_key * solid_angles).sum())
    return np.repeat(painted[..., None], 3, axis=2).astype(np.float32)


def _surroundings(up: Doubles) -> Doubles:
    """By the sine of the height above the horizon, at which it is brightest."""
    sky = HORIZON + (SKY - HORIZON) * np.sqrt(np.clip(up, 0, 1))
    t = _smooth(np.clip(up / math.sin(math.radians(BLEND_DEG)) + 1, 0, 1))
    return GROUND + (sky - GROUND) * t


def _axis(box: Softbox, light_from_camera: Doubles) -> Doubles:
    axis: Doubles = light_from_camera @ (np.array(box.towards) / np.linalg.norm(box.towards))
    return axis


def _within(box: Softbox, cosines: Doubles) -> Doubles:
    """1 at its middle, 0 outside."""
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    return _smooth(np.clip((box.outer_deg - angles) / (box.outer_deg - box.inner_deg), 0, 1))


def _smooth(t: Doubles) -> Doubles:
    eased: Doubles = t * t * (3 - 2 * t)
    return eased
