"""What moves in a compared scene, as time samples: frame 0, shutter from -0.5 to 0.5."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Usd, UsdGeom, Vt

from .scene import Glide, Pan, Scene

SHUTTER = (-0.5, 0.5)


def write_motion(stage: Usd.Stage, scene: Scene, camera: str) -> None:
    for mesh, glide in scene.glides.items():
        _glide(UsdGeom.Xformable(stage.GetPrimAtPath(f"/world/geometry/{mesh}")), glide)
    for mesh, points in scene.ends.items():
        ends = (scene.meshes[mesh].points, points)
        _arrays(UsdGeom.Mesh(stage.GetPrimAtPath(f"/world/geometry/{mesh}")).GetPointsAttr(), *ends)
    placed = scene.placed
    if placed is not None and placed.swarm is not None and placed.shifts is not None:
        half = placed.shifts[placed.swarm] / 2
        instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/world/geometry/placed"))
        _arrays(instancer.GetPositionsAttr(), placed.positions - half, placed.positions + half)
    lens = UsdGeom.Camera(stage.GetPrimAtPath(camera))
    lens.CreateShutterOpenAttr(SHUTTER[0])
    lens.CreateShutterCloseAttr(SHUTTER[1])
    if scene.pan is not None:
        _pan(lens, scene.pan)


def _arrays(attribute: Usd.Attribute, first: np.ndarray, last: np.ndarray) -> None:  # type: ignore[type-arg]
    for time, points in zip(SHUTTER, (first, last), strict=True):
        attribute.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32)), time)


def _travel(op: UsdGeom.XformOp, middle: tuple[float, ...], shift: tuple[float, ...]) -> None:
    for time in SHUTTER:
        op.Set(Gf.Vec3d(*(m + s * time for m, s in zip(middle, shift, strict=True))), time)


def _turn(op: UsdGeom.XformOp, turn_deg: float) -> None:
    for time in SHUTTER:
        op.Set(turn_deg * time, time)


def _glide(prim: UsdGeom.Xformable, glide: Glide) -> None:
    _travel(prim.AddTranslateOp(), glide.center, glide.shift)
    _turn(prim.AddRotateYOp(), glide.turn_deg)


def _pan(camera: UsdGeom.Camera, pan: Pan) -> None:
    camera.ClearXformOpOrder()
    _travel(camera.AddTranslateOp(), pan.eye, pan.shift)
    _turn(camera.AddRotateYOp(), pan.turn_deg)
    camera.AddRotateXOp().Set(-pan.down_deg)
