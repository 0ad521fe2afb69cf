"""A camera that is moved by hand: about a point, sideways, nearer, through the scene.

Mouse drags are fractions of the picture's height. The point that the camera goes around need not be in the middle of the
picture: choosing another one moves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Doubles
from ..camera import Camera, Projection
from ..description.placement import Box

TURN = math.pi  # radians for a drag over the picture's height
STEEPEST = math.cos(math.radians(89.5))  # least dot product of the camera's up axis and the stage's: below 0 it is upside down
ROOM = 1.1  # radius of the framed sphere over that of the box
NEAREST = 1e-3  # least distance to the target, as a fraction of the scene's size


@dataclass(frozen=True, eq=False)
class Orbit:
    """A camera that orbits a target. `rotation` (3, 3): the camera's right, up and backward axes in the world, as unit
    columns."""

    target: Doubles  # (3,) world
    rotation: Doubles
    eye: Doubles  # (3,) world
    up: Doubles  # (3,) world: the stage's up axis
    zoom: float = 1.0  # of an orthographic camera's window

    @property
    def distance(self) -> float:
        """Scene units from the eye to the target, along the camera's axis."""
        return float((self.eye - self.target) @ self.rotation[:, 2])

    @property
    def world_from_camera(self) -> Doubles:
        """Matrix (4, 4), column-vector."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.eye
        return matrix

    def about(self, target: Doubles) -> Orbit:
        """Return the same camera with another target, if that is in front of it."""
        chosen = replace(self, target=np.asarray(target, np.float64))
        return chosen if chosen.distance > 0 else self

    def tumbled(self, across: float, down: float) -> Orbit:
        """Return the orbit turned about the target: objects follow the mouse. The camera never turns over."""
        turn = self._turn(-TURN * across, -TURN * down)
        return replace(self, rotation=turn @ self.rotation, eye=self.target + turn @ (self.eye - self.target))

    def looking(self, across: float, down: float) -> Orbit:
        """Return the camera turned where it is; the target goes with it."""
        turn = self._turn(TURN * across, TURN * down)
        return replace(self, rotation=turn @ self.rotation, target=self.eye + turn @ (self.target - self.eye))

    def _turn(self, about_up: float, about_right: float) -> Doubles:
        """Return the rotation (3, 3) by these angles about the stage's up axis and the camera's right one; without the latter
        where the camera would turn over."""
        level = _rotation(self.up, about_up)
        turned = level @ self.rotation
        tilt = _rotation(turned[:, 0], about_right)
        upright = min(float(turned[:, 1] @ self.up) - 1e-12, STEEPEST)
        return tilt @ level if float((tilt @ turned)[:, 1] @ self.up) >= upright else level

    def panned(self, across: float, down: float, camera: Camera) -> Orbit:
        """Return the camera moved sideways, so that what is as far away as the target follows the mouse."""
        height = camera.window[3] - camera.window[2]
        if camera.projection is Projection.PERSPECTIVE:
            height *= self.distance
        return self._moved(height * (down * self.rotation[:, 1] - across * self.rotation[:, 0]))

    def dollied(self, steps: float, camera: Camera) -> Orbit:
        """Return the orbit moved towards the target, by a factor of e per step; an orthographic window shrinks instead."""
        factor = math.exp(-steps)
        if camera.projection is Projection.ORTHOGRAPHIC:
            return replace(self, zoom=self.zoom * factor)
        return replace(self, eye=self.target + factor * (self.eye - self.target))

    def flown(self, ahead: float, across: float, up: float) -> Orbit:
        """Return the camera moved along its axis, to its right and along the stage's up axis, by parts of the distance to the
        target; the target stays as far ahead as it was."""
        x, z = self.rotation[:, 0], self.rotation[:, 2]
        return self._moved(self.distance * (across * x + up * self.up - ahead * z))

    def _moved(self, step: Doubles) -> Orbit:
        return replace(self, target=self.target + step, eye=self.eye + step)

    def framed(self, box: Box, camera: Camera) -> Orbit:
        """Return the orbit in the same direction with the whole box in the picture."""
        low, high = (np.asarray(corner, np.float64) for corner in box)
        radius = max(float(np.linalg.norm(high - low)) / 2, 1e-9)
        left, right, bottom, top = camera.window
        side = min(right - left, top - bottom)
        target = (low + high) / 2
        if camera.projection is Projection.ORTHOGRAPHIC:
            zoom = self.zoom * ROOM * 2 * radius / side
            eye = target + max(self.distance, 2 * radius) * self.rotation[:, 2]
            return replace(self, target=target, zoom=zoom, eye=eye)
        distance = ROOM * radius / math.sin(math.atan(side / 2))
        return replace(self, target=target, eye=target + distance * self.rotation[:, 2])


def orbit_of(camera: Camera, box: Box | None, z_up: bool) -> Orbit:
    """Return the orbit of a camera about the point on its axis that is nearest to the centre of the scene's box."""
    matrix = np.asarray(camera.world_from_camera, np.float64)
    up = np.array([0.0, 0.0, 1.0] if z_up else [0.0, 1.0, 0.0])
    rotation, eye = matrix[:3, :3].copy(), matrix[:3, 3].copy()
    distance = camera.focus_distance if 0 < camera.focus_distance < math.inf else 1.0
    if box is not None:
        low, high = (np.asarray(corner, np.float64) for corner in box)
        size = float(np.linalg.norm(high - low))
        ahead = float((eye - (low + high) / 2) @ rotation[:, 2])
        distance = max(ahead, NEAREST * size, 1e-9) if ahead > 0 or size > 0 else distance
    return Orbit(eye - rotation[:, 2] * distance, rotation, eye, up)


def _rotation(axis: Doubles, angle: float) -> Doubles:
    """Return the rotation (3, 3) about a unit axis (Rodrigues' formula)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: Doubles = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)
    return turned
