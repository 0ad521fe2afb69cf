"""The default light of a stage without lights: a photographer's studio that the camera does not see.

A large soft key light over the camera's left shoulder, and a dome that is brighter on its right and behind, with a sky above a
darker ground. Its level shows mid-grey that faces the camera as mid-grey in the default view, whatever the exposure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles, Floats
from ...description import Camera, Light, LightType

STUDIO, KEY = "primray:default-light", "primray:default-key"
# Radiance of diffuse white that faces the camera. In the default view (ACES 2.0) albedo 0.18 then shows as 119 (sRGB encodes it
# as 118), and the ColorChecker's patches are nearest to their albedos: mean CIEDE2000 3.0; at radiance 1 it is 11.5, at 4 13.1.
# A view without a tone curve shows albedos as they are at --exposure -log2(WHITE), which docs/command-line.md names as -0.81.
WHITE = 1.75
KEY_SHARE = 0.8  # of WHITE
TO_KEY = (-0.5, 0.7, 1.0)  # in the camera's frame: right, up, back
KEY_ANGLE_DEG = 20.0  # soft shadows, and light samples alone find it: wider, it is noisier
HEIGHT = 32  # rows of the dome's image, which has no edges
# Relative radiances. The sky is so even that BSDF samples find it; it takes no light samples.
GROUND, HORIZON, SKY = 0.4, 1.0, 0.8
BLEND_DEG = 30.0  # of the ground into the horizon


@dataclass(frozen=True)
class Glow:
    """A brighter part of the sky that fades to 0 at its half-angle."""

    towards: tuple[float, float, float]  # as TO_KEY
    radiance: float
    half_angle_deg: float


TO_CAMERA = (0.0, 0.0, 1.0)
GLOWS = (
    Glow((1.0, 0.2, 0.6), 0.8, 75.0),  # fill
    Glow((0.5, 0.7, -1.0), 1.0, 60.0),  # behind: edges stand out from a dark background
)


def default_lights(camera: Camera, z_up: bool) -> tuple[Light, Light]:
    """Return a dome and a distant light that give white which faces the camera the radiance `WHITE`, after its exposure."""
    world_from_light = np.eye(4)
    if z_up:
        world_from_light[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    # Rounded, so that cameras whose matrices differ by rounding take the same samples.
    light_from_camera = np.round(world_from_light[:3, :3].T @ camera.world_from_camera[:3, :3], 9)
    white = WHITE / camera.exposure_scale if 0 < camera.exposure_scale < math.inf else WHITE
    # Irradiance of a distant light: pi L sin^2 of its half-angle (UsdLux, DistantLight), times the cosine.
    cosine = TO_KEY[2] / float(np.linalg.norm(TO_KEY))
    key = white * KEY_SHARE / (cosine * math.sin(math.radians(KEY_ANGLE_DEG / 2)) ** 2)
    image, surroundings = _painted(light_from_camera), white * (1 - KEY_SHARE)
    return (
        Light(STUDIO, LightType.DOME, world_from_light, (surroundings,) * 3, image=image, visible_to_camera=False),
        Light(KEY, LightType.DISTANT, _key_frame(camera), (key,) * 3, angle_deg=KEY_ANGLE_DEG, visible_to_camera=False),
    )


def _key_frame(camera: Camera) -> Doubles:
    """Return the key light's frame (4, 4), +Z towards the light."""
    z = _axis(TO_KEY, camera.world_from_camera[:3, :3])
    x = np.cross(camera.world_from_camera[:3, 1], z)
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return m


def _painted(light_from_camera: Doubles) -> Floats:
    """Return (HEIGHT, 2 HEIGHT, 3) in a dome's lat-long layout; the irradiance of what faces the camera is pi."""
    polar = (np.arange(HEIGHT) + 0.5) * (math.pi / HEIGHT)  # from +Y, which the first row is at
    around = (0.5 - (np.arange(2 * HEIGHT) + 0.5) / (2 * HEIGHT)) * 2 * math.pi  # s = 0.5 - atan2(x, z) / 2 pi
    up = np.broadcast_to(np.cos(polar)[:, None], (HEIGHT, 2 * HEIGHT))
    level = np.sin(polar)[:, None]
    directions = np.stack([level * np.sin(around), up, level * np.cos(around)], axis=-1)
    painted = _surroundings(directions[..., 1])
    for glow in GLOWS:
        painted = painted + glow.radiance * _within(glow, directions @ _axis(glow.towards, light_from_camera))
    solid_angles = level * (math.pi / HEIGHT) ** 2
    facing_camera = np.clip(directions @ _axis(TO_CAMERA, light_from_camera), 0, None)
    painted *= math.pi / float((painted * facing_camera * solid_angles).sum())
    return np.repeat(painted[..., None], 3, axis=2).astype(np.float32)


def _surroundings(up: Doubles) -> Doubles:
    """Return the sky's and ground's radiance for sines of the elevation; the horizon is brightest."""
    sky = HORIZON + (SKY - HORIZON) * np.sqrt(np.clip(up, 0, 1))
    t = _smooth(np.clip(up / math.sin(math.radians(BLEND_DEG)) + 1, 0, 1))
    return GROUND + (sky - GROUND) * t


def _axis(towards: tuple[float, float, float], from_camera: Doubles) -> Doubles:
    """Return the unit vector (3,) of a direction in the camera's frame, rotated by the (3, 3) matrix."""
    axis: Doubles = from_camera @ (np.array(towards) / np.linalg.norm(towards))
    return axis


def _within(glow: Glow, cosines: Doubles) -> Doubles:
    """Return a glow's share by the cosine to its centre: 1 at the centre, 0 outside its half-angle."""
    return _smooth(np.clip(1 - np.degrees(np.arccos(np.clip(cosines, -1, 1))) / glow.half_angle_deg, 0, 1))


def _smooth(t: Doubles) -> Doubles:
    eased: Doubles = t * t * (3 - 2 * t)
    return eased
