"""The camera of a stage that has none: the one usdrecord frames it with (UsdAppUtilsFrameRecorder)."""

from __future__ import annotations

import math

import numpy as np
from pxr import Usd, UsdGeom

from ..description import Camera, Doubles, Projection
from .adapters.camera import Aperture, conform, window_of
from .adapters.render_settings import StageSettings
from .read import When

# GfCamera's defaults: 50 mm, 35 mm projector aperture.
FOCAL_LENGTH = 50.0
APERTURE = Aperture(20.955, 15.2908)


def framing_camera(stage: Usd.Stage, when: When, resolution: tuple[int, int], stage_settings: StageSettings) -> Camera:
    """At the centre of the bounds, back from it far enough for them to fit; nothing is clipped."""
    center, size = _bounds(stage, when, stage_settings.purposes)
    z_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
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
    aperture = conform(APERTURE, resolution, stage_settings)
    return Camera("", world_from_camera, Projection.PERSPECTIVE, window_of(aperture, 1 / FOCAL_LENGTH), (0.0, 3e38))


def _bounds(stage: Usd.Stage, when: When, purposes: tuple[str, ...]) -> tuple[Doubles, Doubles]:
    """Centre and size of the world's box; a unit box where the stage is empty or its bounds are not finite."""
    time = Usd.TimeCode.EarliestTime() if when.careful else when.time
    cache = UsdGeom.BBoxCache(time, list(purposes), useExtentsHint=True)
    box = cache.ComputeWorldBound(stage.GetPseudoRoot())
    aligned = box.ComputeAlignedRange()
    if aligned.IsEmpty():
        return np.zeros(3), np.ones(3)
    center, size = np.array(box.ComputeCentroid()), np.array(aligned.GetSize())
    if not (np.isfinite(center).all() and np.isfinite(size).all()):
        return np.zeros(3), np.ones(3)
    return center, size
