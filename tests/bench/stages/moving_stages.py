"""Generated stages that move while the shutter is open: a terrain whose vertices do, and a field of instances.

`times`: at how many even times of the exposure everything is known; between them it is linear, so that the renderer needs
those and no more. Written as usdc; frame 0, shutter from -0.5 to 0.5.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, Vt
from tests.bench.peers.shapes import Triangles, ball, bumps

CAMERA = "/camera"
SHUTTER = (-0.5, 0.5)


def write(kind: str, count: int, times: int, path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetTimeCodesPerSecond(1.0)
    WRITERS[kind](stage, count, np.linspace(*SHUTTER, times))
    UsdLux.DomeLight.Define(stage, "/sky").CreateIntensityAttr(1.0)
    sun = UsdLux.DistantLight.Define(stage, "/sun")
    sun.CreateIntensityAttr(50_000.0)
    sun.AddRotateXYZOp().Set(Gf.Vec3f(-50, 30, 0))
    _camera(stage)
    stage.GetRootLayer().Save()


def _camera(stage: Usd.Stage) -> None:
    """Over a square of 100 about the origin, from one edge and above."""
    camera = UsdGeom.Camera.Define(stage, CAMERA)
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 35, 75))
    camera.AddRotateXOp().Set(-28.0)
    camera.GetHorizontalApertureAttr().Set(36.0)
    camera.GetFocalLengthAttr().Set(30.0)
    camera.CreateShutterOpenAttr(SHUTTER[0])
    camera.CreateShutterCloseAttr(SHUTTER[1])


def _terrain(stage: Usd.Stage, count: int, times: np.ndarray) -> None:  # type: ignore[type-arg]
    """Waves that travel over one grid of triangles, by a few of their edges from first to last."""
    n = max(1, round(np.sqrt(count / 2)))
    x, z = np.meshgrid(np.linspace(-50, 50, n + 1), np.linspace(-50, 50, n + 1), indexing="ij")
    at = np.arange((n + 1) * (n + 1), dtype=np.int32).reshape(n + 1, n + 1)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    grid = _mesh(stage, "/grid", Triangles(np.zeros((at.size, 3)), faces))
    for time in times:
        height = 3 * np.sin(0.3 * x + 2 * time) * np.cos(0.2 * z + time)
        points = np.stack([x + 0.3 * np.sin(z + 3 * time), height, z], axis=-1).reshape(-1, 3)
        grid.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)), float(time))


def _stones(stage: Usd.Stage, count: int, turning: bool) -> UsdGeom.PointInstancer:
    """Instances of one stone of 2,048 triangles, each flying its own way; by their positions' samples."""
    rng = np.random.default_rng(2)
    stone = ball(4)
    field = UsdGeom.PointInstancer.Define(stage, "/field")
    field.CreatePrototypesRel().SetTargets(["/field/stone"])
    field.CreateProtoIndicesAttr(Vt.IntArray(count))
    size = 60 / np.sqrt(count)
    points = stone.points * (size * (1 + 0.9 * bumps(stone.points, 3, 3.5, 21)))[:, None]
    _mesh(stage, "/field/stone", Triangles(points, stone.faces)).GetPointsAttr().Set(
        Vt.Vec3fArray.FromNumpy(points.astype("f4"))
    )
    angle = rng.uniform(0, np.pi, count)
    orientations = np.zeros((count, 4), np.float16)
    orientations[:, 1], orientations[:, 3] = np.sin(angle), np.cos(angle)  # about y; memory order x, y, z, w
    field.CreateOrientationsAttr().Set(Vt.QuathArray.FromNumpy(orientations), 0.0 if turning else Usd.TimeCode.Default())
    return field


def _places(count: int, times: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """(times, count, 3): curves of about a stone's width."""
    rng = np.random.default_rng(3)
    start = np.zeros((count, 3))
    start[:, [0, 2]] = rng.uniform(-50, 50, (count, 2))
    speed, bend = (rng.normal(size=(count, 3)) * 60 / np.sqrt(count) for _ in range(2))
    return np.stack([start + speed * t + 2 * bend * t * t for t in times]).astype(np.float32)


def _instances(stage: Usd.Stage, count: int, times: np.ndarray) -> None:  # type: ignore[type-arg]
    field = _stones(stage, count, turning=False)
    for time, places in zip(times, _places(count, times), strict=True):
        field.GetPositionsAttr().Set(Vt.Vec3fArray.FromNumpy(places), float(time))


def _turning(stage: Usd.Stage, count: int, times: np.ndarray) -> None:  # type: ignore[type-arg]
    """Straight, turning at a constant rate; `times` is not asked."""
    field = _stones(stage, count, turning=True)
    field.GetPositionsAttr().Set(Vt.Vec3fArray.FromNumpy(_places(count, times[:1] * 0)[0]), 0.0)
    rng = np.random.default_rng(4)
    velocities = rng.normal(size=(count, 3)) * 60 / np.sqrt(count)
    field.CreateVelocitiesAttr().Set(Vt.Vec3fArray.FromNumpy(velocities.astype(np.float32)), 0.0)
    turns = rng.normal(size=(count, 3)) * 40  # degrees
    field.CreateAngularVelocitiesAttr().Set(Vt.Vec3fArray.FromNumpy(turns.astype(np.float32)), 0.0)


def _mesh(stage: Usd.Stage, path: str, shape: Triangles) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.faces), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(shape.faces.ravel(), np.int32)))
    mesh.CreateSubdivisionSchemeAttr("none")
    return mesh


WRITERS: dict[str, Callable[[Usd.Stage, int, np.ndarray], None]] = {  # type: ignore[type-arg]
    "terrain": _terrain,
    "instances": _instances,
    "turning": _turning,
}
