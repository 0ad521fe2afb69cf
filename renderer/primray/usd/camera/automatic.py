"""Cameras of stages without one: that of an authoring tool's viewport, a three-quarter view from above, or usdrecord's framing.

The three-quarter view is as near as the scene fits into the frame with a margin; usdrecord's (UsdAppUtilsFrameRecorder) looks
at the centre of the stage's bounds.

The view that a viewport showed last is in `cameraSettings` of customLayerData, as Omniverse Kit writes it. `boundCamera` is the
path of the camera looked through: a prim, or one of Kit's own four, which live in its session and of which only a dictionary
stays behind: `position` and `target` of Perspective; `position` and `radius` of Front, Right and Top.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pxr import Sdf, Usd

from ...arrays import Doubles
from ...description import Camera, Projection
from ...description.placement import Box
from ..render_settings.render_product import ProductSettings
from ..scene.bounds import Bounds
from ..scene.context import Context
from ..stage.metadata import is_number, layer_data, shown, up_axis
from ..stage.reads import type_name
from .camera import UNCLIPPED, Aperture, conform, nearest_of, window_of
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
    axes = world_from_camera[:3, :3]
    world_from_camera[:3, 3] = eye = _position(framed, axes, window[1] * inside, window[3] * inside)
    nearest = nearest_of(-framed.reach(axes[:, 2], eye))
    return Camera("", world_from_camera, Projection.PERSPECTIVE, window, UNCLIPPED, nearest=nearest), left_out


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
    nearest = nearest_of(distance - size[depth] / 2)
    window = window_of(aperture, 1 / FOCAL_LENGTH)
    return Camera("", world_from_camera, Projection.PERSPECTIVE, window, UNCLIPPED, nearest=nearest)


CAMERA_SETTINGS = "cameraSettings"
PERSPECTIVE = "Perspective"
BOUND_TO_PERSPECTIVE = "/OmniverseKit_Persp"
KIT_CAMERAS = {BOUND_TO_PERSPECTIVE: PERSPECTIVE} | {f"/OmniverseKit_{name}": name for name in ("Front", "Right", "Top")}
KIT_FOCAL_LENGTH = 18.147562  # Kit's perspective camera, for GfCamera's aperture: 60 degrees
# Kit's orthographic cameras by up axis: the world axis each looks along, its usual side, the up direction of its image.
Side = tuple[int, float, tuple[float, float, float]]
SIDES: dict[str, dict[str, Side]] = {
    "Y": {"Front": (2, 1.0, (0, 1, 0)), "Right": (0, -1.0, (0, 1, 0)), "Top": (1, 1.0, (0, 0, -1))},
    "Z": {"Front": (0, 1.0, (0, 0, 1)), "Right": (1, -1.0, (0, 0, 1)), "Top": (2, 1.0, (-1, 0, 0))},
}


def bound_camera(ctx: Context) -> Usd.Prim | None:
    """Return the stage's camera that the viewport looked through, with a diagnostic; None if it was none of these."""
    settings = layer_data(ctx.stage, CAMERA_SETTINGS)
    path = settings.get("boundCamera") if isinstance(settings, Mapping) else None
    if not isinstance(path, str) or not Sdf.Path.IsValidPathString(path) or not Sdf.Path(path).IsAbsolutePath():
        return None
    prim = ctx.stage.GetPrimAtPath(path)
    if not prim or type_name(prim) != "Camera":
        return None
    ctx.warn("camera-viewport", path, "The camera of the authoring tool's viewport is used.")
    return prim


def viewport_camera(ctx: Context) -> Camera | None:
    """Return the tool's own camera that the viewport looked through; None without one. Report an unusable one."""
    settings = layer_data(ctx.stage, CAMERA_SETTINGS)
    if settings is None:
        return None
    bound = settings.get("boundCamera", BOUND_TO_PERSPECTIVE) if isinstance(settings, Mapping) else None
    if not isinstance(settings, Mapping) or not isinstance(bound, str):
        why = (
            f"has the boundCamera {shown(bound)}, which is not a path"
            if isinstance(settings, Mapping)
            else f"is {shown(settings)}"
        )
        _report_unusable(ctx, why)
        return None
    name = KIT_CAMERAS.get(bound)
    if name is None:
        ctx.warn("camera-viewport", "", f"The authoring tool's viewport used the camera {bound}, which does not exist.")
        return None
    if name not in settings:
        return None
    made = _perspective(settings[name], ctx) if name == PERSPECTIVE else _orthographic(settings[name], name, ctx)
    if made is None:
        wanted = "a target away from it" if name == PERSPECTIVE else "a radius above 0"
        _report_unusable(ctx, f"has an unusable {name}: a position and {wanted} are needed, not {shown(settings[name])}")
        return None
    ctx.warn("camera-viewport", "", f"The stage has no camera: {name} of the authoring tool's viewport is used.")
    return made


def _report_unusable(ctx: Context, why: str) -> None:
    ctx.warn("stage-metadata", "", f"customLayerData's {CAMERA_SETTINGS} {why}: it is ignored.", "customLayerData")


def _perspective(values: Any, ctx: Context) -> Camera | None:
    position, target = _point(values, "position"), _point(values, "target")
    if position is None or target is None:
        return None
    back = _unit(position - target)
    if back is None:
        return None
    up = np.array([0.0, 0, 1] if up_axis(ctx.stage) == "Z" else [0.0, 1, 0])
    if np.linalg.norm(np.cross(up, back)) < 1e-6:  # straight down or up: the image's up is that of Top
        up = np.array(SIDES[up_axis(ctx.stage)]["Top"][2], float) * math.copysign(1.0, float(up @ back))
    window = window_of(APERTURE, 1 / KIT_FOCAL_LENGTH)
    return Camera("", _looking(position, back, up), Projection.PERSPECTIVE, window, UNCLIPPED)


def _orthographic(values: Any, name: str, ctx: Context) -> Camera | None:
    """Return an orthographic camera that looks towards the origin from its position; `radius` is half of the visible width."""
    position = _point(values, "position")
    radius = _length(values)
    if position is None or radius is None:
        return None
    axis, side, up = SIDES[up_axis(ctx.stage)][name]
    back = np.zeros(3)
    back[axis] = math.copysign(1.0, position[axis]) if position[axis] else side
    window = window_of(Aperture(2 * radius, 2 * radius / APERTURE.aspect), 1.0)
    return Camera("", _looking(position, back, np.array(up, float)), Projection.ORTHOGRAPHIC, window, UNCLIPPED)


def _length(values: Any) -> float | None:
    found: Any = values.get("radius") if isinstance(values, Mapping) else None
    return float(found) if is_number(found) and 0 < found < math.inf else None


def _looking(position: Doubles, back: Doubles, up: Doubles) -> Doubles:
    """Return world_from_camera with the image's up direction as near to `up` as possible."""
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    world_from_camera = np.eye(4)
    world_from_camera[:3] = np.column_stack([right, np.cross(back, right), back, position])
    return world_from_camera


def _unit(v: Doubles) -> Doubles | None:
    largest = float(np.abs(v).max())
    if not 0 < largest < math.inf:
        return None
    return np.asarray(v / largest / np.linalg.norm(v / largest))


def _point(values: Any, name: str) -> Doubles | None:
    """Return a point (3,) of finite numbers; None for anything else."""
    try:
        found = np.array([float(x) for x in values[name]])
    except (KeyError, TypeError, ValueError, IndexError):
        return None
    return found if found.shape == (3,) and np.isfinite(found).all() else None
