"""The seam's interpolation of random stages against USD's transforms at many times: within the pixels that are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from primray.description import SceneDescription
from primray.description.motion import segment_of
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.camera.motion import interpolated_camera

from ..unit.usd.motion.reference import matrix_at, world_at
from .random_motion import FRAME, stage_text

RESOLUTION = (640, 360)
CORNERS = np.array([[x, y, z, 1] for x in (-0.25, 0.25) for y in (-0.25, 0.25) for z in (-0.25, 0.25)])
ERROR = 0.05


def translated(seed: int) -> tuple[SceneDescription, Usd.Stage]:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(f"#usda 1.0\n{stage_text(seed)}")
    settings = RenderSettings(time_code=FRAME, resolution=RESOLUTION, camera="cam", motion_error=ERROR)
    d, diagnostics = translate(stage, settings)
    assert not [x.message for x in diagnostics if x.code == "motion"]
    assert d.exposure is not None
    return d, stage


def world_of_usd(stage: Usd.Stage, path: str, time: float) -> np.ndarray:
    return np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(stage.GetPrimAtPath(path))).T


def time_of(stage: Usd.Stage, path: str, offset: float) -> float:
    return FRAME + offset * float(UsdGeom.MotionAPI(stage.GetPrimAtPath(path)).ComputeMotionBlurScale())


def instances_of_usd(stage: Usd.Stage, offset: float) -> np.ndarray:
    """(K, 4, 4)"""
    time = time_of(stage, "/p/i", offset)
    (found,) = UsdGeom.PointInstancer(stage.GetPrimAtPath("/p/i")).ComputeInstanceTransformsAtTimes([time], FRAME)
    return world_of_usd(stage, "/p/i", time) @ np.array(found).transpose(0, 2, 1)


def pixels_apart(d: SceneDescription, found: np.ndarray, true: np.ndarray) -> float:
    a, b = ((CORNERS @ m.T)[:, :3] for m in (found, true))
    return float(np.linalg.norm(d.camera.project(a, RESOLUTION) - d.camera.project(b, RESOLUTION), axis=1).max())


@pytest.mark.parametrize("seed", range(24))
def test_paths_are_usds(seed: int) -> None:
    d, stage = translated(seed)
    assert d.exposure is not None
    first, last = d.exposure.span
    for fraction in np.linspace(0, 1, 41).tolist():
        offset = first + fraction * (last - first)
        (cube,) = world_at(d, "/a/b/c", fraction)
        assert pixels_apart(d, cube, world_of_usd(stage, "/a/b/c", time_of(stage, "/a/b/c", offset))) < ERROR + 2e-3
        (native,) = world_at(d, "/n/k", fraction)
        assert pixels_apart(d, native, world_of_usd(stage, "/n/k", time_of(stage, "/n", offset))) < ERROR + 2e-3
        for found, true in zip(world_at(d, "/p/i/q", fraction), instances_of_usd(stage, offset), strict=True):
            assert pixels_apart(d, found, true) < ERROR + 2e-3


@pytest.mark.parametrize("seed", range(24))
def test_lights_and_cameras_are_where_usd_has_them(seed: int) -> None:
    d, stage = translated(seed)
    assert d.exposure is not None
    (light,) = d.lights
    first, last = d.exposure.span
    for fraction in np.linspace(0, 1, 41).tolist():
        time = FRAME + first + fraction * (last - first)
        found = light.world_from_light if light.motion is None else matrix_at(light.motion, fraction)
        assert pixels_apart(d, found, world_of_usd(stage, "/l", time)) < ERROR + 2e-3
        camera = d.camera
        if d.camera_motion is not None:
            k, u = segment_of(d.camera_motion.times, fraction)
            camera = interpolated_camera(d.camera_motion.cameras[k], d.camera_motion.cameras[k + 1], u)
        true = world_of_usd(stage, "/far/cam", time)
        points = np.array([[x, y, -20.0, 1.0] for x in (-3, 0, 3) for y in (-2, 0, 2)]) @ true.T
        expected = (points @ np.linalg.inv(true).T)[:, :3]
        assert np.abs((points @ np.linalg.inv(camera.world_from_camera).T)[:, :3] - expected).max() < ERROR / 20
