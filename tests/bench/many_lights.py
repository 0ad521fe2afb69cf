"""Many small sphere lights over a floor with boxes and balls: python -m tests.bench.many_lights FOLDER [COUNT ...].

Writes lights_COUNT.usdc, and lights_COUNT.json with .ply files as the peers' runners read them (shared/peers/scenes.py), both
of the same numbers. Lights differ in power by a factor of some hundred; their sum does not depend on how many there are.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt

COUNTS = (5, 17, 100, 500, 10_000, 100_000)
RESOLUTION, DEPTH = (640, 360), 4
EYE, AT, FOV_DEG = (0.0, 8.5, 14.0), (0.0, 0.2, 0.5), 48.0
HALF_FLOOR = 14.0
POWER = 500 * 4 * math.pi**2 * 0.04**2 * 100  # of all lights, in watts a channel for white ones

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    points: Doubles
    faces: npt.NDArray[np.int64]  # triangles
    color: tuple[float, float, float]


@dataclass(frozen=True)
class Spheres:
    """The lights: centres, radii, radiance."""

    at: Doubles
    radius: Doubles
    radiance: Doubles


def box(center: Doubles, half: Doubles, turn: float) -> tuple[Doubles, npt.NDArray[np.int64]]:
    c, s = math.cos(turn), math.sin(turn)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c_, d in quads for t in ((a, b, c_), (a, c_, d))])
    return corners @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + center, faces


def ball(center: Doubles, radius: float, rings: int = 24) -> tuple[Doubles, npt.NDArray[np.int64]]:
    """A sphere of triangles, with both poles as rows of equal points left out."""
    theta = np.pi * np.arange(1, rings) / rings
    phi = np.pi * np.arange(2 * rings) / rings
    t, f = np.meshgrid(theta, phi, indexing="ij")
    points = np.stack([np.sin(t) * np.cos(f), np.cos(t), np.sin(t) * np.sin(f)], axis=-1).reshape(-1, 3)
    points = np.vstack([points, [[0, 1, 0], [0, -1, 0]]])
    n, rows = 2 * rings, rings - 1
    top, bottom = rows * n, rows * n + 1
    faces = []
    for k in range(n):
        right = (k + 1) % n
        faces += [(top, right, k), (bottom, (rows - 1) * n + k, (rows - 1) * n + right)]
        for r in range(rows - 1):
            a, b, c, d = r * n + k, r * n + right, (r + 1) * n + right, (r + 1) * n + k
            faces += [(a, b, c), (a, c, d)]
    return points * radius + center, np.array(faces)


def shapes() -> list[Shape]:
    rng = np.random.default_rng(11)
    s = HALF_FLOOR
    floor = np.array([[-s, 0, -s], [-s, 0, s], [s, 0, s], [s, 0, -s]])
    made = [Shape(floor, np.array([[0, 1, 2], [0, 2, 3]]), (0.5, 0.48, 0.45))]
    for k in range(48):
        half = rng.uniform([0.2, 0.2, 0.2], [0.7, 1.1, 0.7])
        x, z = rng.uniform(-0.85 * s, 0.85 * s, 2)
        color = tuple(float(c) for c in rng.uniform(0.2, 0.8, 3))
        if k % 4 == 3:
            points, faces = ball(np.array([x, half[0], z]), float(half[0]))
        else:
            points, faces = box(np.array([x, half[1], z]), half, float(rng.uniform(0, np.pi)))
        made.append(Shape(points, faces, (color[0], color[1], color[2])))
    return made


def spheres(count: int) -> Spheres:
    rng = np.random.default_rng(count)
    s = 0.9 * HALF_FLOOR
    at = np.stack([rng.uniform(-s, s, count), rng.uniform(0.3, 3.5, count), rng.uniform(-s, s, count)], axis=1)
    radius = np.full(count, 0.04 * min(1.0, math.sqrt(500 / count))) * rng.uniform(0.6, 1.4, count)
    tint = rng.uniform(0.4, 1.0, (count, 3))
    power = np.exp(rng.normal(0, 1, count))
    power *= POWER / power.sum()
    return Spheres(at, radius, tint * (power / (4 * np.pi**2 * radius**2))[:, None])


def write_usd(lights: Spheres, path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for k, shape in enumerate(shapes()):
        mesh = UsdGeom.Mesh.Define(stage, f"/geo/shape_{k}")
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(shape.points.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.faces), 3))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.faces.astype(np.int32).ravel()))
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*shape.color)])
    layer = stage.GetRootLayer()
    with Sdf.ChangeBlock():
        for k, (at, radius, radiance) in enumerate(zip(lights.at, lights.radius, lights.radiance, strict=True)):
            prim = Sdf.CreatePrimInLayer(layer, f"/lights/light_{k}")
            prim.specifier, prim.typeName = Sdf.SpecifierDef, "SphereLight"
            peak = float(radiance.max())
            for name, type_name, value in (
                ("inputs:radius", Sdf.ValueTypeNames.Float, float(radius)),
                ("inputs:intensity", Sdf.ValueTypeNames.Float, peak),
                ("inputs:color", Sdf.ValueTypeNames.Color3f, Gf.Vec3f(*(float(c) / peak for c in radiance))),
                ("xformOp:translate", Sdf.ValueTypeNames.Double3, Gf.Vec3d(*map(float, at))),
            ):
                Sdf.AttributeSpec(prim, name, type_name).default = value
            order = Sdf.AttributeSpec(prim, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
            order.default = Vt.TokenArray(["xformOp:translate"])
        scope = Sdf.CreatePrimInLayer(layer, "/lights")
        scope.specifier, scope.typeName = Sdf.SpecifierDef, "Xform"
    camera = UsdGeom.Camera.Define(stage, "/World/cam")
    z = np.array(EYE) - AT
    z /= np.linalg.norm(z)
    x = np.cross((0, 1, 0), z)
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :4] = np.stack([x, np.cross(z, x), z, EYE], axis=1)
    camera.AddTransformOp().Set(Gf.Matrix4d(*m.T.ravel().tolist()))
    w, h = RESOLUTION
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(36.0 * h / w)
    camera.CreateFocalLengthAttr(18 / math.tan(math.radians(FOV_DEG / 2)))
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1e5))
    assert UsdLux.SphereLight(stage.GetPrimAtPath("/lights/light_0"))
    layer.Save()


def write_ply(shape: Shape, path: Path) -> None:
    faces = np.zeros(len(shape.faces), dtype=[("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, shape.faces
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(shape.points)}"]
    lines += [f"property float {c}" for c in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(lines).encode() + shape.points.astype("<f4").tobytes() + faces.tobytes())


def write_peers(lights: Spheres, folder: Path, name: str) -> None:
    made = shapes()
    for k, shape in enumerate(made):
        write_ply(shape, folder / f"{name}_shape_{k}.ply")
    rows = zip(lights.at, lights.radius, lights.radiance, strict=True)
    described = {
        "name": name,
        "res": RESOLUTION,
        "depth": DEPTH,
        "cam": {"eye": EYE, "at": AT, "fov": FOV_DEG},
        "mats": {f"mat_{k}": ["diffuse", shape.color] for k, shape in enumerate(made)},
        "objs": [[f"shape_{k}", f"mat_{k}"] for k in range(len(made))],
        "lights": [{"type": "sphere", "c": c.tolist(), "r": float(r), "L": L.tolist()} for c, r, L in rows],
        "smooth": [],
    }
    (folder / f"{name}.json").write_text(json.dumps(described))


def write(count: int, folder: Path) -> Path:
    """The stage's path."""
    folder.mkdir(parents=True, exist_ok=True)
    lights, name = spheres(count), f"lights_{count}"
    path = folder / f"{name}.usdc"
    path.unlink(missing_ok=True)
    write_usd(lights, path)
    write_peers(lights, folder, name)
    return path


if __name__ == "__main__":
    for wanted in [int(c) for c in sys.argv[2:]] or COUNTS:
        print(write(wanted, Path(sys.argv[1])))
