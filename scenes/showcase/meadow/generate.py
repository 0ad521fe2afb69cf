"""Writes field.usdc (ground, grass, stones, flowers) and sky.exr for scene.usda. Made for primray; Apache-2.0.

python scenes/showcase/meadow/generate.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

HERE = Path(__file__).parent
GRASS, STONES, FLOWERS = 14000, 260, 420
CLEARING = 2.35  # radius around the plinth without plants
rng = np.random.default_rng(7)


def height(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The ground: gentle hills that rise away from the plinth."""
    r = np.hypot(x, z)
    waves = 0.35 * np.sin(0.35 * x + 0.8) * np.cos(0.3 * z - 0.4) + 0.12 * np.sin(0.9 * x - 0.5 * z)
    waves *= np.clip((45 - r) / 25, 0, 1)
    return np.asarray(np.clip((r - 2.6) / 6, 0, 1) * (waves + np.clip(0.02 * (r - 8), 0, 0.9)))


def mesh(
    stage: Usd.Stage, path: str, points: np.ndarray, faces: np.ndarray, colors: np.ndarray, interpolation: str
) -> UsdGeom.Mesh:
    made = UsdGeom.Mesh.Define(stage, path)
    made.CreateSubdivisionSchemeAttr("none")
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), faces.shape[1], np.int32)))
    made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()))
    made.CreateExtentAttr([Gf.Vec3f(*points.min(0).tolist()), Gf.Vec3f(*points.max(0).tolist())])
    primvar = made.CreateDisplayColorPrimvar(interpolation)
    primvar.Set(Vt.Vec3fArray.FromNumpy(np.atleast_2d(colors).astype(np.float32)))
    return made


def smooth(made: UsdGeom.Mesh, normals: np.ndarray) -> None:
    made.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
    made.SetNormalsInterpolation("vertex")


def ground(stage: Usd.Stage) -> None:
    n = 110
    u = np.linspace(-1, 1, n)
    line = 30 * u * np.abs(u) + 270 * u * np.abs(u) ** 7  # fine in the middle, out to the horizon
    x, z = np.meshgrid(line, line, indexing="ij")
    y = height(x, z)
    points = np.stack([x, y, z], -1).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    a = (i * n + k).ravel()
    faces = np.stack([a, a + 1, a + n + 1, a + n], 1)
    mix = (0.5 + 0.5 * np.sin(1.7 * x + 2.1 * z) * np.cos(1.1 * z - 0.6 * x)).reshape(-1, 1)
    colors = mix * (0.085, 0.10, 0.03) + (1 - mix) * (0.13, 0.095, 0.05)
    made = mesh(stage, "/field/ground", points, faces, colors, "vertex")
    e = 1e-3
    dx, dz = (height(x + e, z) - height(x - e, z)) / (2 * e), (height(x, z + e) - height(x, z - e)) / (2 * e)
    normals = np.stack([-dx, np.ones_like(dx), -dz], -1).reshape(-1, 3)
    smooth(made, normals / np.linalg.norm(normals, axis=1, keepdims=True))


def tuft(stage: Usd.Stage, path: str, blades: int, tall: float) -> None:
    """Bent blades, each three tapering quads ending in a tip."""
    points, faces, colors = [], [], []
    for _ in range(blades):
        angle, lean = rng.uniform(0, 2 * np.pi), rng.uniform(0.15, 0.75)
        length, width = tall * rng.uniform(0.55, 1), rng.uniform(0.006, 0.012)
        out = np.array([np.cos(angle), 0, np.sin(angle)])
        side = np.array([-np.sin(angle), 0, np.cos(angle)])
        root = rng.uniform(0, 0.07) * out
        first = len(points)
        green = np.array([0.10, 0.24, 0.035]) * rng.uniform(0.7, 1.3) + np.array([0.09, 0.03, 0]) * rng.uniform(0, 1)
        for t in (0, 0.4, 0.75, 1):
            centre = root + length * (out * lean * t * t + np.array([0, t * (1 - 0.25 * lean * t), 0]))
            half = width * (1 - t) ** 0.6
            points += [centre - half * side, centre + half * side] if t < 1 else [centre]
            colors += [green * (0.5 + 0.6 * t)] * (2 if t < 1 else 1)
        faces += [[first, first + 1, first + 3], [first, first + 3, first + 2], [first + 2, first + 3, first + 5]]
        faces += [[first + 2, first + 5, first + 4], [first + 4, first + 5, first + 6]]
    mesh(stage, path, np.array(points), np.array(faces), np.array(colors), "vertex")


def sphere_grid(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions and quads (triangles at the poles are quads with a doubled corner)."""
    theta = np.linspace(0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None]
    d = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) * np.ones_like(phi), np.sin(theta) * np.sin(phi)], -1)
    i, k = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a, b = i * columns + k, i * columns + (k + 1) % columns
    return d.reshape(-1, 3), np.stack([a, b, b + columns, a + columns], -1).reshape(-1, 4)


def stone(stage: Usd.Stage, path: str, tint: tuple[float, float, float]) -> None:
    d, faces = sphere_grid(14, 22)
    lumps = sum(a * np.sin(d @ rng.normal(0, f, 3) + rng.uniform(0, 6)) for f, a in ((2.0, 0.16), (4.0, 0.07), (9.0, 0.025)))
    points = d * (1 + np.asarray(lumps))[:, None] * (1, 0.62, 0.85)
    shade = np.clip(0.8 + 2 * np.asarray(lumps), 0.4, 1.3)[:, None]
    mesh(stage, path, points, faces, shade * np.array(tint), "vertex")


def flower(stage: Usd.Stage, path: str, petal: tuple[float, float, float]) -> None:
    points: list[np.ndarray] = [np.array([-0.005, 0, 0]), np.array([0.005, 0, 0]), np.array([0, 0.34, 0])]
    faces, colors = [[0, 1, 2]], [(0.08, 0.2, 0.03)]
    for k in range(7):
        a = 2 * np.pi * k / 7
        out, side = np.array([np.cos(a), 0, np.sin(a)]), np.array([-np.sin(a), 0, np.cos(a)])
        centre = np.array([0, 0.34, 0])
        first = len(points)
        points += [centre, centre + 0.035 * out - 0.016 * side + (0, 0.018, 0), centre + 0.06 * out + (0, 0.012, 0)]
        points += [centre + 0.035 * out + 0.016 * side + (0, 0.018, 0)]
        faces += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
        colors += [petal] * 2
    d, quads = sphere_grid(4, 8)
    first = len(points)
    points += list(d * (0.016, 0.01, 0.016) + (0, 0.346, 0))
    for a, b, c, e in quads:
        top, bottom = max(a, b) < 8, min(c, e) >= 4 * 8  # one triangle at the poles
        faces += [[first + a, first + b, first + c]] * (not top) + [[first + a, first + c, first + e]] * (not bottom)
        colors += [(0.75, 0.5, 0.05)] * (2 - top - bottom)
    mesh(stage, path, np.array(points), np.array(faces), np.array(colors), "uniform")


def scatter(count: int, near: float, far: float) -> np.ndarray:
    """Positions on the ground, denser near the middle, none in the clearing."""
    r = near + (far - near) * rng.uniform(0, 1, count) ** 0.8
    a = rng.uniform(0, 2 * np.pi, count)
    x, z = r * np.cos(a), r * np.sin(a)
    return np.stack([x, height(x, z), z], 1)


def instancer(stage: Usd.Stage, name: str, prototypes: list[str], positions: np.ndarray, sizes: np.ndarray) -> None:
    made = UsdGeom.PointInstancer.Define(stage, f"/field/{name}")
    made.CreatePrototypesRel().SetTargets([Sdf.Path(p) for p in prototypes])
    made.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(rng.integers(0, len(prototypes), len(positions)).astype(np.int32)))
    made.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions.astype(np.float32)))
    turn = rng.uniform(0, np.pi, len(positions))
    made.CreateOrientationsAttr(Vt.QuathArray([Gf.Quath(float(np.cos(t)), 0.0, float(np.sin(t)), 0.0) for t in turn]))
    made.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.repeat(sizes[:, None], 3, 1).astype(np.float32)))


def field() -> None:
    path = HERE / "field.usdc"
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/field").GetPrim())
    ground(stage)
    names = ("grass", "stones", "flowers")
    for name in names:
        UsdGeom.PointInstancer.Define(stage, f"/field/{name}")
    grass = [f"/field/grass/tuft{k}" for k in range(4)]
    for k, name in enumerate(grass):
        tuft(stage, name, 18, 0.24 + 0.05 * k)
    stones = [f"/field/stones/stone{k}" for k in range(3)]
    for name, tint in zip(stones, ((0.30, 0.28, 0.25), (0.22, 0.22, 0.23), (0.34, 0.29, 0.22)), strict=True):
        stone(stage, name, tint)
    flowers = [f"/field/flowers/flower{k}" for k in range(3)]
    for name, petal in zip(flowers, ((0.85, 0.85, 0.8), (0.75, 0.12, 0.25), (0.3, 0.2, 0.75)), strict=True):
        flower(stage, name, petal)
    instancer(stage, "grass", grass, scatter(GRASS, CLEARING, 17), rng.uniform(0.7, 1.6, GRASS))
    instancer(stage, "stones", stones, scatter(STONES, CLEARING + 0.1, 14), 0.05 + 0.28 * rng.uniform(0, 1, STONES) ** 4)
    instancer(stage, "flowers", flowers, scatter(FLOWERS, CLEARING, 11), rng.uniform(0.8, 1.5, FLOWERS))
    stage.GetRootLayer().Save()


def torus() -> None:
    """The copper ring on the plinth, with its normals."""
    path = HERE / "ring.usdc"
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    around, across = 96, 36
    u = 2 * np.pi * np.arange(around)[:, None] / around
    v = 2 * np.pi * np.arange(across)[None] / across
    normal = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v) + 0 * u], -1)
    centre = np.stack([np.cos(u) + 0 * v, np.sin(u) + 0 * v, 0 * u + 0 * v], -1)
    i, k = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = i * across + k, ((i + 1) % around) * across + k
    c, d = ((i + 1) % around) * across + (k + 1) % across, i * across + (k + 1) % across
    faces = np.stack([a, b, c, d], -1).reshape(-1, 4)
    points = (0.5 * centre + 0.14 * normal).reshape(-1, 3)
    made = mesh(stage, "/ring", points, faces, np.array([[0.8, 0.4, 0.25]]), "constant")
    smooth(made, normal.reshape(-1, 3))
    stage.SetDefaultPrim(made.GetPrim())
    stage.GetRootLayer().Save()


def sky() -> None:
    """A late-afternoon gradient in Rec.709: warm horizon, blue zenith, a glow around the sun of scene.usda."""
    width, rows = 256, 128
    s, v = (np.arange(width) + 0.5) / width, (np.arange(rows) + 0.5) / rows
    lon, theta = (0.5 - s)[None] * 2 * np.pi, (v * np.pi)[:, None]
    d = np.stack([np.sin(theta) * np.sin(lon), np.cos(theta) + 0 * lon, np.sin(theta) * np.cos(lon)], -1)
    up = np.clip(d[..., 1:2], 0, 1)
    image = (1 - up) ** 4 * (0.95, 0.72, 0.52) + (1 - (1 - up) ** 4) * (0.16, 0.32, 0.72)
    towards_sun = np.array([-0.62, 0.42, 0.30])
    cosine = np.clip(d @ (towards_sun / np.linalg.norm(towards_sun)), 0, 1)[..., None]
    image = image + (0.9, 0.65, 0.4) * cosine**24 + (0.35, 0.22, 0.12) * cosine**4
    image = np.where(d[..., 1:2] < 0, (0.10, 0.085, 0.06), image)
    spec = oiio.ImageSpec(width, rows, 3, "half")
    spec.attribute("compression", "zip")
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    out = oiio.ImageOutput.create(str(HERE / "sky.exr"))
    out.open(str(HERE / "sky.exr"), spec)
    out.write_image(image.astype(np.float32))
    out.close()


if __name__ == "__main__":
    field()
    torus()
    sky()
