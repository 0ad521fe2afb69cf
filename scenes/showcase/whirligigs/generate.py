"""Writes toys.usdc (pinwheels, a top, balls, confetti, bulbs) and planks.jpg for scene.usda. Made for primray; Apache-2.0.

python scenes/showcase/whirligigs/generate.py

Lengths are centimetres, the shutter is open for 1/48 s. Speeds are real ones: balls fall by 981 cm/s^2.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

HERE = Path(__file__).parent
FPS, FRAME = 24.0, 1.0  # what moves by velocities has them at this frame
GRAVITY = 981.0
rng = np.random.default_rng(11)

RED, AMBER, CREAM = (0.62, 0.03, 0.03), (0.85, 0.36, 0.03), (0.80, 0.74, 0.60)
TEAL, NAVY, PINK = (0.02, 0.30, 0.30), (0.03, 0.07, 0.32), (0.72, 0.12, 0.22)
FOOT = [(3.3, 0.0), (3.6, 0.3), (3.4, 0.9), (1.5, 1.5), (1.0, 2.3), (0.0, 2.4)]  # radius and height
TOP = [(0.0, 0.0), (0.35, 0.25), (1.3, 1.6), (5.2, 4.0), (6.4, 5.0), (6.3, 5.8), (3.4, 6.7), (1.0, 7.5), (0.62, 9.4)]
TOP += [(0.85, 10.3), (0.0, 10.9)]
PAPER = (RED, AMBER, CREAM, TEAL, NAVY, PINK)


def vectors(values: np.ndarray) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def mesh(
    stage: Usd.Stage, path: str, points: np.ndarray, faces: np.ndarray, colors: np.ndarray, normals: np.ndarray | None = None
) -> UsdGeom.Mesh:
    """`colors`: one a face, or one for all."""
    made = UsdGeom.Mesh.Define(stage, path)
    made.CreateSubdivisionSchemeAttr("none")
    made.CreatePointsAttr(vectors(points))
    made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), faces.shape[1], np.int32)))
    made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()))
    made.CreateExtentAttr([Gf.Vec3f(*points.min(0).tolist()), Gf.Vec3f(*points.max(0).tolist())])
    colors = np.atleast_2d(colors)
    made.CreateDisplayColorPrimvar("constant" if len(colors) == 1 else "uniform").Set(vectors(colors))
    if normals is not None:
        made.CreateNormalsAttr(vectors(normals))
        made.SetNormalsInterpolation("vertex")
    return made


def bind(prim: Usd.Prim, material: str) -> None:
    made = UsdShade.Material(prim.GetStage().GetPrimAtPath(f"/toys/materials/{material}"))
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(made)


def material(stage: Usd.Stage, name: str, own: tuple[float, float, float] | None = None, **inputs: float) -> None:
    """Of this colour, or of that of what it is bound to."""
    path = f"/toys/materials/{name}"
    made, shader = UsdShade.Material.Define(stage, path), UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    for key, value in inputs.items():
        shader.CreateInput(key, Sdf.ValueTypeNames.Float).Set(value)
    color = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if own is not None:
        color.Set(Gf.Vec3f(*own))
    else:
        reader = UsdShade.Shader.Define(stage, f"{path}/color")
        reader.CreateIdAttr("UsdPrimvarReader_float3")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
        color.ConnectToSource(reader.CreateOutput("result", Sdf.ValueTypeNames.Float3))
    made.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))


def lathe(profile: np.ndarray, around: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, quads and normals of a curve (r, y) turned around +Y."""
    tangent = np.gradient(profile, axis=0)
    out = np.stack([tangent[:, 1], -tangent[:, 0]], 1)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    phi = 2 * np.pi * np.arange(around) / around
    ring = np.stack([np.cos(phi), np.sin(phi)], 1)

    def turned(rows: np.ndarray) -> np.ndarray:
        x, z = rows[:, None, 0] * ring[None, :, 0], rows[:, None, 0] * ring[None, :, 1]
        return np.stack([x, np.repeat(rows[:, 1:2], around, 1), z], -1).reshape(-1, 3)

    i, k = np.meshgrid(np.arange(len(profile) - 1), np.arange(around), indexing="ij")
    a, b = i * around + k, i * around + (k + 1) % around
    return turned(profile), np.stack([a, a + around, b + around, b], -1).reshape(-1, 4), turned(out)


def curve(knots: list[tuple[float, float]], steps: int) -> np.ndarray:
    """Through the knots (Catmull and Rom 1974)."""
    p = np.array([knots[0], *knots, knots[-1]], float)
    t = np.linspace(0, 1, steps, endpoint=False)[:, None]
    parts = []
    for a, b, c, d in zip(p[:-3], p[1:-2], p[2:-1], p[3:], strict=True):
        parts.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
    return np.concatenate([*parts, p[-1:]])


def spun(prim: Usd.Prim, op: str, turns_per_second: float) -> None:
    """At constant speed, given for the frames 0 to 2."""
    at = getattr(UsdGeom.Xformable(prim), f"AddRotate{op}Op")()
    for frame in (0.0, 1.0, 2.0):
        at.Set(360 * turns_per_second / FPS * frame, frame)


def pinwheel(
    stage: Usd.Stage, name: str, at: tuple[float, float, float], size: float, turn: float, hues: tuple[int, int], speed: float
) -> None:
    """Eight blades of paper that curl towards the viewer, on a stick; `turn`: degrees about its stick."""
    path = f"/toys/{name}"
    root = UsdGeom.Xform.Define(stage, path)
    root.AddTranslateOp().Set(Gf.Vec3d(at[0], 0, at[2]))
    root.AddRotateYOp().Set(turn)
    wheel = UsdGeom.Xform.Define(stage, f"{path}/wheel")
    wheel.AddTranslateOp().Set(Gf.Vec3d(0, at[1], 1.2))
    spun(wheel.GetPrim(), "Z", speed)
    n = 14
    u, v = np.meshgrid(np.linspace(0.04, 1, n), np.linspace(0, 1, n), indexing="ij")
    points, faces, colors, normals = [], [], [], []
    for blade in range(8):
        angle = 2 * np.pi * blade / 8 + v * (1.2 - 0.24 * u) - 0.18 * u
        radius = size * u * (1 - 0.13 * v**2)
        grid = np.stack([radius * np.cos(angle), radius * np.sin(angle), size * (0.05 + 0.34 * v**2.2 * u**0.8)], -1)
        du, dv = np.gradient(grid, axis=0), np.gradient(grid, axis=1)
        normal = np.cross(du, dv)
        normals.append((normal / np.linalg.norm(normal, axis=-1, keepdims=True)).reshape(-1, 3))
        i, k = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
        a = (blade * n * n + i * n + k).ravel()
        faces.append(np.stack([a, a + n, a + n + 1, a + 1], 1))
        points.append(grid.reshape(-1, 3))
        colors += [PAPER[hues[blade % 2]]] * (n - 1) ** 2
    whole, corners, across = map(np.concatenate, (points, faces, normals))
    blades = mesh(stage, f"{path}/wheel/blades", whole, corners, np.array(colors), across)
    blades.CreateDoubleSidedAttr(True)
    bind(blades.GetPrim(), "paper")
    pin = UsdGeom.Sphere.Define(stage, f"{path}/wheel/pin")
    pin.CreateRadiusAttr(size * 0.085)
    pin.AddTranslateOp().Set(Gf.Vec3d(0, 0, size * 0.1))
    bind(pin.GetPrim(), "brass")
    stick = UsdGeom.Cylinder.Define(stage, f"{path}/stick")
    stick.CreateAxisAttr("Y")
    stick.CreateHeightAttr(at[1])
    stick.CreateRadiusAttr(0.32)
    stick.AddTranslateOp().Set(Gf.Vec3d(0, at[1] / 2, 0))
    stick.CreateDisplayColorAttr([Gf.Vec3f(0.5, 0.33, 0.17)])
    bind(stick.GetPrim(), "wood")
    points, faces, normals = lathe(curve(FOOT, 8), 64)
    foot = mesh(stage, f"{path}/foot", points, faces, np.array([(0.42, 0.26, 0.13)]), normals)
    bind(foot.GetPrim(), "wood")


def top(stage: Usd.Stage) -> None:
    """Spins about its own axis, which leans and goes around slowly."""
    points, faces, normals = lathe(curve(TOP, 10), 180)
    middle = points[faces].mean(axis=1)
    r, angle = np.hypot(middle[:, 0], middle[:, 2]), np.arctan2(middle[:, 2], middle[:, 0])
    arm = np.floor(3 * (angle / (2 * np.pi) + 0.16 * r)).astype(int) % 3
    colors = np.array([CREAM, RED, NAVY])[arm]
    colors[r < 1.25] = AMBER
    colors[(r > 6.05) | (middle[:, 1] < 1.5)] = AMBER
    path = "/toys/top"
    lean = UsdGeom.Xform.Define(stage, path)
    lean.AddTranslateOp().Set(Gf.Vec3d(-15, 0.02, 19))
    around = lean.AddRotateYOp()
    for frame in (0.0, 1.0, 2.0):
        around.Set(265 + 360 * 1.2 / FPS * frame, frame)
    lean.AddRotateZOp().Set(-15)
    body = mesh(stage, f"{path}/body", points, faces, colors, normals)
    spun(body.GetPrim(), "Y", 6.5)
    bind(body.GetPrim(), "lacquer")


def instancer(stage: Usd.Stage, name: str, positions: np.ndarray, kinds: np.ndarray) -> UsdGeom.PointInstancer:
    made = UsdGeom.PointInstancer.Define(stage, f"/toys/{name}")
    made.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(kinds.astype(np.int32)))
    made.CreatePositionsAttr().Set(vectors(positions), FRAME)
    return made


def balls(stage: Usd.Stage) -> None:
    """One after another they bounce off the table, 0.33 s from one bounce to the next."""
    radius, up = 2.1, 165.0
    since = 0.036 + 0.0655 * np.arange(8)  # seconds after the first bounce
    period = 2 * up / GRAVITY
    t = since % period
    run = np.array([-66.0, 0, 8.0])
    positions = np.array([41.0, 0, 12.0]) + run * since[:, None]
    positions[:, 1] = radius + up * t - GRAVITY / 2 * t**2
    velocities = np.repeat(run[None], len(t), 0)
    velocities[:, 1] = up - GRAVITY * t
    made = instancer(stage, "balls", positions, np.arange(len(t)) % 3)
    made.CreateVelocitiesAttr().Set(vectors(velocities), FRAME)
    made.CreateAccelerationsAttr().Set(vectors(np.repeat([[0, -GRAVITY, 0]], len(t), 0)), FRAME)
    targets = []
    for name, look, color in (("red", "rubber", RED), ("teal", "rubber", TEAL), ("amber", "rubber", AMBER)):
        ball = UsdGeom.Sphere.Define(stage, f"/toys/balls/{name}")
        ball.CreateRadiusAttr(radius)
        ball.CreateDisplayColorAttr([Gf.Vec3f(*color)])
        bind(ball.GetPrim(), look)
        targets.append(ball.GetPath())
    made.CreatePrototypesRel().SetTargets(targets)


def confetti(stage: Usd.Stage, count: int = 420) -> None:
    positions = np.stack([rng.uniform(-60, 60, count), rng.uniform(3, 44, count), rng.uniform(-75, 45, count)], 1)
    toys = (np.abs(positions[:, 0]) < 26) & (np.abs(positions[:, 2] - 5) < 20)  # what is played with stays free
    positions = positions[~toys | (positions[:, 1] > 27)]
    n = len(positions)
    velocities = np.stack([rng.normal(0, 14, n), rng.uniform(-115, -60, n), rng.normal(0, 14, n)], 1)
    spins = rng.normal(0, 420, (n, 3))
    quaternions = rng.normal(size=(n, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    made = instancer(stage, "confetti", positions, np.zeros(n))
    made.CreateVelocitiesAttr().Set(vectors(velocities), FRAME)
    made.CreateAngularVelocitiesAttr().Set(vectors(spins), FRAME)
    made.CreateOrientationsAttr().Set(Vt.QuathArray([Gf.Quath(*map(float, q)) for q in quaternions]), FRAME)
    made.CreateScalesAttr().Set(vectors(rng.uniform(0.7, 1.3, (n, 1)) * (1, 1, 1)))
    paper = np.array(PAPER)[rng.integers(0, len(PAPER), n)]
    UsdGeom.PrimvarsAPI(made).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex").Set(vectors(paper))
    points = np.array([[-0.6, 0, -0.4], [0.6, 0.08, -0.4], [0.6, 0.08, 0.4], [-0.6, 0, 0.4]])
    piece = mesh(stage, "/toys/confetti/piece", points, np.array([[0, 1, 2, 3]]), np.array([CREAM]))
    piece.GetPrim().RemoveProperty("primvars:displayColor")
    piece.CreateDoubleSidedAttr(True)
    bind(piece.GetPrim(), "paper")
    made.CreatePrototypesRel().SetTargets([piece.GetPath()])


def bulbs(stage: Usd.Stage) -> None:
    """Three strings of them before the wall, 1.6 lm each."""
    positions = []
    for k, (height, sag, z) in enumerate(((31, 7, -112), (23, 9, -104), (12, 6, -118))):
        x = np.linspace(-95, 95, 17 + 2 * k) + rng.uniform(-1.5, 1.5, 17 + 2 * k)
        swing = (x + 24 * (k - 1)) / 63
        positions.append(np.stack([x, height - sag + sag * np.abs((swing + 1) % 2 - 1) ** 2, z + 0 * x], 1))
    where = np.concatenate(positions)
    made = UsdGeom.PointInstancer.Define(stage, "/toys/bulbs")
    made.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.zeros(len(where), np.int32)))
    made.CreatePositionsAttr(vectors(where))
    bulb = UsdLux.SphereLight.Define(stage, "/toys/bulbs/bulb")
    bulb.CreateRadiusAttr(1.1)
    prim = bulb.GetPrim()
    prim.AddAppliedSchema("PhotometricAreaLightAPI")
    prim.AddAppliedSchema("PhysicalLightIlluminantAPI")
    prim.CreateAttribute("photometric:power", Sdf.ValueTypeNames.Float).Set(1.6)
    prim.CreateAttribute("physical:illuminant", Sdf.ValueTypeNames.Token).Set("blackbody")
    bulb.CreateColorTemperatureAttr(2300)
    made.CreatePrototypesRel().SetTargets([prim.GetPath()])


def toys() -> None:
    path = HERE / "toys.usdc"
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetTimeCodesPerSecond(FPS)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/toys").GetPrim())
    material(stage, "paper", roughness=0.6)
    material(stage, "wood", roughness=0.45, clearcoat=0.4, clearcoatRoughness=0.2)
    material(stage, "lacquer", roughness=0.5, clearcoat=1.0, clearcoatRoughness=0.03)
    material(stage, "rubber", roughness=0.28)
    material(stage, "brass", (0.90, 0.62, 0.25), roughness=0.18, metallic=1.0)
    pinwheel(stage, "pinwheel_0", (-8.5, 18.5, -6), 8.2, 14, (0, 2), 3.2)
    pinwheel(stage, "pinwheel_1", (8, 22, -20), 9.0, -6, (3, 1), -1.6)
    pinwheel(stage, "pinwheel_2", (25, 16.5, -10), 7.4, -20, (4, 5), 5.5)
    pinwheel(stage, "pinwheel_3", (-29, 20.5, -24), 8.8, 26, (1, 4), 1.1)
    top(stage)
    balls(stage)
    confetti(stage)
    bulbs(stage)
    stage.GetRootLayer().Save()


def noise(size: int, cells: int) -> np.ndarray:
    """(size, size) smooth, periodic, about 0."""
    grid = rng.normal(0, 1, (cells, cells))
    at = np.arange(size) / size * cells
    i, f = at.astype(int), at % 1
    f = f * f * (3 - 2 * f)
    rows = grid[i] * (1 - f)[:, None] + grid[(i + 1) % cells] * f[:, None]
    return rows[:, i] * (1 - f) + rows[:, (i + 1) % cells] * f


def planks() -> None:
    """Walnut: eight boards, with rings cut lengthwise; sRGB."""
    size, boards = 1024, 8
    y, x = np.mgrid[:size, :size] / size
    board = np.minimum((y * boards).astype(int), boards - 1)
    shift, tone = rng.uniform(0, 9, boards)[board], rng.uniform(-1, 1, boards)[board]
    across = y * boards % 1
    warp = 0.35 * noise(size, 6) + 0.12 * noise(size, 24)
    depth = np.hypot(across - 0.5, 0.22 + 0.06 * np.sin(2 * np.pi * (x + shift)))
    rings = np.sin(2 * np.pi * (9.6 * depth + shift + 0.5 * warp))
    fibre = np.repeat(rng.normal(0, 1, (size, size // 64)), 64, axis=1)
    fibre = (fibre + np.roll(fibre, 21, 1) + np.roll(fibre, 43, 1)) / 3
    mix = np.clip(0.5 + 0.26 * rings + 0.1 * fibre + 0.12 * tone, 0, 1)[..., None]
    color = mix * (0.21, 0.115, 0.06) + (1 - mix) * (0.075, 0.037, 0.02)
    gap = np.minimum(across, 1 - across) < 0.012
    color = np.where(gap[..., None], 0.012, color)
    encoded = np.where(color <= 0.0031308, 12.92 * color, 1.055 * np.clip(color, 1e-9, 1) ** (1 / 2.4) - 0.055)
    spec = oiio.ImageSpec(size, size, 3, "uint8")
    spec.attribute("CompressionQuality", 85)
    out = oiio.ImageOutput.create(str(HERE / "planks.jpg"))
    out.open(str(HERE / "planks.jpg"), spec)
    out.write_image(encoded.astype(np.float32))
    out.close()


if __name__ == "__main__":
    toys()
    planks()
