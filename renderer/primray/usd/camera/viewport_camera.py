"""The view that an authoring tool's viewport showed last: `cameraSettings` in customLayerData, as Omniverse Kit writes it.

`boundCamera` is the path of the camera looked through: a prim, or one of Kit's own four, which live in its session and of which
only a dictionary stays behind: `position` and `target` of Perspective; `position` and `radius` of Front, Right and Top.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pxr import Sdf, Usd

from ...arrays import Doubles
from ...description import Camera, Projection
from ..scene.context import Context
from ..stage.metadata import is_number, layer_data, shown, up_axis
from ..stage.reads import type_name
from .automatic import APERTURE
from .camera import UNCLIPPED, Aperture, window_of

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
