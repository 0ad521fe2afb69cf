"""Automatic cameras of stages without one: a three-quarter view from above, or usdrecord's framing.

The three-quarter view is as near as the scene fits into the frame with a margin; usdrecord's (UsdAppUtilsFrameRecorder) looks
at the centre of the stage's bounds.
"""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Doubles
from ...description import Camera, Projection
from ...description.placement import Box
from ..render_settings.render_product import ProductSettings
from ..scene.bounds import Bounds
from .camera import Aperture, conform, window_of
from .framed_objects import FramedObjects, outliers

# GfCamera's defaults: 50 mm, 35 mm projector aperture.
FOCAL_LENGTH = 50.0
APERTURE = Aperture(20.955, 15.2908)

AZIMUTH_DEG = 35.0  # from the front towards +X
ELEVATION_DEG = 25.0
MARGIN = 0.06  # share of the frame, on each side
GROUND_MARGIN = 0.15  # share of the set's height: width of the ground around it that is framed for its shadow
CLEARANCE = 0.1  # share of the set's size: least distance of the camera in front of it
PASSES = 8  # iterations that centre the axis that does not limit the distance
CENTERING_TOLERANCE = 1e-4  # relative change of the slope at which they end


def three_quarter_camera(
    drawn: FramedObjects, z_up: bool, resolution: tuple[int, int], product: ProductSettings, *, has_ground: bool = False
) -> tuple[Camera, list[str]]:
    """Return the camera, which clips nothing, and the paths of outliers that its frame need not hold.

    `has_ground`: a ground is added below the scene, and its near part is framed.
    """
    out = outliers(drawn.low, drawn.high, drawn.detail, 2 if z_up else 1)
    left_out = drawn.paths(out)
    framed = drawn.only(~out)
    if has_ground:
        framed = framed.with_box(*_near_ground(framed, 2 if z_up else 1))
    window = window_of(conform(APERTURE, resolution, product), 1 / FOCAL_LENGTH)
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = _axes(z_up)
    inside = 1 - 2 * MARGIN
    world_from_camera[:3, 3] = _position(framed, world_from_camera[:3, :3], window[1] * inside, window[3] * inside)
    return Camera("", world_from_camera, Projection.PERSPECTIVE, window, (0.0, 3e38)), left_out


def _near_ground(framed: FramedObjects, up: int) -> Box:
    """Return the low and high corner (3,) of the flat box of ground around the base of the framed objects."""
    low, high = framed.low.min(axis=0), framed.high.max(axis=0)
    room = np.full(3, GROUND_MARGIN * (high[up] - low[up]))
    room[up] = 0.0
    low, high = low - room, high + room
    high[up] = low[up]
    return low, high


def _axes(z_up: bool) -> Doubles:
    """Return the camera's axes (3, 3) as columns: right, up and backward."""
    a, e = math.radians(AZIMUTH_DEG), math.radians(ELEVATION_DEG)
    back = np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)])
    right = np.array([math.cos(a), 0.0, -math.sin(a)])
    axes = np.column_stack([right, np.cross(back, right), back])
    return np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) @ axes if z_up else axes


def _position(drawn: FramedObjects, axes: Doubles, tan_x: float, tan_y: float) -> Doubles:
    """Return the nearest position from which everything is within the tangents, centred horizontally and vertically."""
    low, high = drawn.low.min(axis=0), drawn.high.max(axis=0)
    back = axes[:, 2]
    size = float(np.linalg.norm(high / 2 - low / 2)) * 2
    middle = low / 2 + high / 2
    behind = middle - drawn.reach(-back, middle) * back  # at the depth of what is farthest
    wedges = [_Wedge(drawn, axes[:, k], back, behind, tangent) for k, tangent in enumerate((tan_x, tan_y))]
    depth = max(wedge.apex for wedge in wedges)
    depth = max(depth, drawn.reach(back, behind) + (CLEARANCE * size or 1.0))
    x, y = (wedge.middle(depth) for wedge in wedges)
    return np.asarray(behind + axes @ np.array([x, y, depth]))


class _Wedge:
    """Objects projected to the plane of one image axis and the view axis; the frame's edges have a slope of `tangent`.

    Depths are measured from `origin` towards the camera.
    """

    def __init__(self, drawn: FramedObjects, side: Doubles, back: Doubles, origin: Doubles, tangent: float) -> None:
        self._drawn, self._side, self._back, self._origin, self._tangent = drawn, side, back, origin, tangent
        self._touching = self._reaches(tangent)

    def _reaches(self, tangent: float) -> tuple[float, float]:
        """Return the offsets of the two lines of this slope that touch the objects from both sides."""
        right, left = (self._drawn.reach(side + tangent * self._back, self._origin) for side in (self._side, -self._side))
        return right, left

    @property
    def apex(self) -> float:
        """Depth at which the touching lines of the frame's slope intersect."""
        return sum(self._touching) / (2 * self._tangent)

    def middle(self, depth: float) -> float:
        """Return the position along the image axis from which both sides are equally far from the view axis.

        It is where touching lines of one slope intersect at this depth. The slope falls from the frame's own, so everything
        stays inside the frame after any number of iterations.
        """
        (right, left), before = self._touching, self._tangent
        for _ in range(PASSES):
            tangent = (right + left) / (2 * depth)
            if tangent > before * (1 - CENTERING_TOLERANCE):
                break
            (right, left), before = self._reaches(tangent), tangent
        return (right - left) / 2


def framing_camera(bounds: Bounds, z_up: bool, resolution: tuple[int, int], product: ProductSettings) -> Camera:
    """Return a camera that looks at the centre of the bounds, far enough away for them to fit; nothing is clipped."""
    center, size = bounds
    up, depth = (2, 1) if z_up else (1, 2)
    radius = math.hypot(size[0], size[up]) / 2
    tan_half = APERTURE.width / (2 * FOCAL_LENGTH)
    distance = radius / tan_half + size[depth] / 2
    if distance < 1:  # GfCamera's near plane
        distance += 1
    world_from_camera = np.eye(4)
    if z_up:  # looks along +Y with +Z up
        world_from_camera[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    world_from_camera[:3, 3] = center
    world_from_camera[depth, 3] += -distance if z_up else distance
    aperture = conform(APERTURE, resolution, product)
    return Camera("", world_from_camera, Projection.PERSPECTIVE, window_of(aperture, 1 / FOCAL_LENGTH), (0.0, 3e38))
