"""Writes scene.usda, geometry.usdc and dusk.exr: a street of instances after rain. Made for primray; Apache-2.0.

python -m scenes.gallery.street.generate

Façades are point instances of a few modules 2 m wide, coloured house by house; trees, lamps and cars are instances too.
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, UsdGeom, UsdShade, Vt
from scenes.gallery.making import Scene, dusk, joined, lathe, rounded_box, smoothed, vectors

rng = np.random.default_rng(12)
WIDE, STOREY = 2.0, 3.1  # of a module
KERB, HOUSES, NEAR, FAR = 4.2, 7.6, 10.0, -92.0  # along x, along z

scene = Scene(__file__, "A street at dusk after rain: façades, trees, lamps and cars are instances.")
scene.camera(eye=(-1.2, 1.55, 9.5), at=(0.35, 3.3, -20), focal_length=30)

scene.material("asphalt", base_color=(0.030, 0.032, 0.036), specular_roughness=0.34)
scene.material("puddle", base_color=(0.012, 0.013, 0.015), specular_roughness=0.02)
scene.material("kerb", base_color=(0.22, 0.21, 0.20), specular_roughness=0.45)
scene.material("paving", base_color=(0.13, 0.125, 0.12), specular_roughness=0.38)
scene.material("stone", base_color=(0.33, 0.31, 0.28), specular_weight=0.0)
scene.material("frame", base_color=(0.42, 0.40, 0.37), specular_roughness=0.5)
scene.material("iron", base_color=(0.025, 0.028, 0.03), specular_roughness=0.45)
scene.material("bark", base_color=(0.07, 0.05, 0.038), specular_weight=0.0)
scene.material("leaf", base_color=(0.075, 0.11, 0.03), specular_roughness=0.55)
scene.material("glass", base_color=(0.008, 0.010, 0.014), specular_roughness=0.03)
scene.material("tyre", base_color=(0.012, 0.012, 0.012), specular_roughness=0.7)
for name, color, luminance in (
    ("lamp", (1.0, 0.66, 0.34), 38.0),
    ("warm", (1.0, 0.60, 0.26), 2.6),
    ("amber", (1.0, 0.48, 0.17), 1.5),
    ("cool", (0.72, 0.84, 1.0), 1.4),
    ("shop", (1.0, 0.76, 0.48), 5.0),
    ("tail", (1.0, 0.03, 0.02), 7.0),
):
    scene.material(name, base_color=(0.0, 0.0, 0.0), specular_roughness=0.1, emission_color=color, emission_luminance=luminance)
for name, tint in (("red", (0.28, 0.02, 0.018)), ("blue", (0.02, 0.05, 0.14)), ("silver", (0.32, 0.33, 0.34))):
    scene.material(f"car_{name}", base_color=tint, specular_roughness=0.35, coat_weight=1.0, coat_roughness=0.03)


def wall_material() -> None:
    """Of its house's colour: the instance's displayColor."""
    made = UsdShade.Material.Define(scene.stage, "/looks/wall")
    surface = UsdShade.Shader.Define(scene.stage, "/looks/wall/surface")
    reader = UsdShade.Shader.Define(scene.stage, "/looks/wall/color")
    surface.CreateIdAttr("UsdPreviewSurface")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    types = Sdf.ValueTypeNames
    surface.CreateInput("diffuseColor", types.Color3f).ConnectToSource(reader.CreateOutput("result", types.Float3))
    surface.CreateInput("roughness", types.Float).Set(0.8)
    made.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))


Corners = tuple[tuple[float, float, float], tuple[float, float, float]]


def part(path: str, material: str, *boxes: Corners, edge: float = 0.008) -> None:
    scene.mesh(path, *joined([rounded_box(low, high, edge) for low, high in boxes]), material)


def around(low: tuple[float, float], high: tuple[float, float], tall: float) -> list[Corners]:
    """The wall of a module around an opening: it looks along +Z, x from 0 to WIDE, 0.35 deep."""
    (x0, y0), (x1, y1) = low, high
    return [
        ((0, 0, -0.35), (x0, tall, 0)),
        ((x1, 0, -0.35), (WIDE, tall, 0)),
        ((x0, 0, -0.35), (x1, y0, 0)),
        ((x0, y1, -0.35), (x1, tall, 0)),
    ]


def window(path: str, glow: str | None) -> None:
    low, high = (0.48, 0.78), (1.52, 2.62)
    part(f"{path}/wall", "wall", *around(low, high, STOREY), edge=0.002)
    surround = [((low[0] - 0.09, high[1], -0.02), (high[0] + 0.09, high[1] + 0.16, 0.05))]
    surround += [((low[0] - 0.12, low[1] - 0.09, -0.06), (high[0] + 0.12, low[1], 0.1))]
    surround += [((x - 0.09, low[1], -0.02), (x, high[1], 0.03)) for x in (low[0], high[0] + 0.09)]
    part(f"{path}/surround", "stone", *surround)
    bars = [((x, low[1], -0.24), (x + 0.055, high[1], -0.19)) for x in (low[0], 0.9725, high[0] - 0.055)]
    bars += [((low[0], y, -0.235), (high[0], y + 0.05, -0.195)) for y in (low[1], 1.95, high[1] - 0.05)]
    part(f"{path}/bars", "frame", *bars, edge=0.006)
    pane = np.array([(low[0], low[1], -0.22), (high[0], low[1], -0.22), (high[0], high[1], -0.22), (low[0], high[1], -0.22)])
    scene.mesh(f"{path}/pane", pane, [[0, 1, 2, 3]], glow or "glass")


def balcony(path: str) -> None:
    window(path, "amber")
    bars = [((x, 0.62, 0.5), (x + 0.018, 1.45, 0.518)) for x in np.arange(0.2, 1.82, 0.115)]
    bars += [((0.18, y, 0.49), (1.82, y + 0.035, 0.53)) for y in (0.64, 1.45)]
    bars += [((x, y, 0.0), (x + 0.03, y + 0.035, 0.52)) for x in (0.18, 1.79) for y in (0.64, 1.45)]
    part(f"{path}/rail", "iron", *bars, edge=0.004)
    part(f"{path}/slab", "stone", ((0.12, 0.5, 0.0), (1.88, 0.62, 0.56)))


def shop(path: str, glow: str) -> None:
    low, high = (0.12, 0.42), (1.88, 2.75)
    part(f"{path}/wall", "iron", *around(low, high, STOREY + 0.5), edge=0.004)
    part(f"{path}/sign", "stone", ((0.0, 2.95, 0.0), (WIDE, 3.45, 0.07)))
    part(f"{path}/bars", "iron", *[((x, low[1], -0.2), (x + 0.05, high[1], -0.14)) for x in (low[0], 0.975, high[0] - 0.05)])
    pane = np.array([(low[0], low[1], -0.17), (high[0], low[1], -0.17), (high[0], high[1], -0.17), (low[0], high[1], -0.17)])
    scene.mesh(f"{path}/pane", pane, [[0, 1, 2, 3]], glow)
    slope = np.array(
        [(0.02, 2.9, 0.05), (1.98, 2.9, 0.05), (1.98, 2.5, 1.0), (0.02, 2.5, 1.0), (1.98, 2.36, 1.01), (0.02, 2.36, 1.01)]
    )
    scene.mesh(f"{path}/awning", slope, [[3, 2, 1, 0], [5, 4, 2, 3]], "wall")


def door(path: str) -> None:
    low, high = (0.5, 0.0), (1.5, 2.75)
    part(f"{path}/wall", "wall", *around(low, high, STOREY + 0.5), edge=0.002)
    part(
        f"{path}/leaf",
        "car_blue",
        ((0.5, 0.1, -0.28), (1.5, 2.2, -0.22)),
        ((0.62, 0.25, -0.23), (0.95, 1.1, -0.2)),
        ((1.05, 0.25, -0.23), (1.38, 1.1, -0.2)),
    )
    pane = np.array([(0.55, 2.28, -0.24), (1.45, 2.28, -0.24), (1.45, 2.7, -0.24), (0.55, 2.7, -0.24)])
    scene.mesh(f"{path}/pane", pane, [[0, 1, 2, 3]], "warm")
    part(f"{path}/step", "stone", ((0.35, 0.0, -0.3), (1.65, 0.1, 0.3)))


def crown(path: str) -> None:
    part(
        f"{path}/cornice",
        "stone",
        ((0, 0.0, -0.35), (WIDE, 0.14, 0.16)),
        ((0, 0.14, -0.35), (WIDE, 0.34, 0.34)),
        ((0, 0.34, -0.35), (WIDE, 0.42, 0.42)),
    )
    part(f"{path}/teeth", "stone", *[((x, -0.12, -0.02), (x + 0.14, 0.14, 0.2)) for x in np.arange(0.1, 1.9, 0.33)])


def instancer(
    path: str, prototypes: list[str], kinds: list[int], places: list, turns: list | None = None, colors: list | None = None
) -> None:
    with scene.bulk():
        made = UsdGeom.PointInstancer.Define(scene.stage, path)
        made.CreatePrototypesRel().SetTargets([Sdf.Path(p) for p in prototypes])
        made.CreateProtoIndicesAttr(Vt.IntArray(kinds))
        made.CreatePositionsAttr(vectors(np.array(places)))
        if turns is not None:
            quats = [Gf.Quath(float(np.cos(t / 2)), 0, float(np.sin(t / 2)), 0) for t in np.radians(turns)]
            made.CreateOrientationsAttr(Vt.QuathArray(quats))
        if colors is not None:
            primvar = UsdGeom.PrimvarsAPI(made).CreatePrimvar(
                "displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex
            )
            primvar.Set(vectors(np.array(colors)))


TINTS = [
    (0.42, 0.33, 0.23),
    (0.36, 0.16, 0.10),
    (0.45, 0.42, 0.36),
    (0.24, 0.27, 0.29),
    (0.50, 0.36, 0.22),
    (0.30, 0.30, 0.22),
    (0.40, 0.22, 0.16),
]
MODULES = ["dark", "warm", "amber", "cool", "balcony", "shop", "shop_cool", "door", "cornice"]


def houses() -> None:
    base = "/modules"
    window(f"{base}/dark", None)
    window(f"{base}/warm", "warm")
    window(f"{base}/amber", "amber")
    window(f"{base}/cool", "cool")
    balcony(f"{base}/balcony")
    shop(f"{base}/shop", "shop")
    shop(f"{base}/shop_cool", "warm")
    door(f"{base}/door")
    crown(f"{base}/cornice")
    kinds, places, turns, colors, solids = [], [], [], [], []
    for side in (-1, 1):
        z, k = NEAR, int(rng.integers(7))
        while z > FAR:
            count, storeys = int(rng.integers(4, 7)), int(rng.integers(3, 6))
            tint = np.array(TINTS[k % 7]) * rng.uniform(0.85, 1.1)
            k += int(rng.integers(1, 4))
            entry, style = int(rng.integers(count)), rng.uniform()
            for column in range(count):
                for storey in range(storeys + 2):
                    if storey == 0:
                        kind = 7 if column == entry else 5 if rng.uniform() < 0.5 else 6
                    elif storey == storeys + 1:
                        kind = 8
                    else:
                        lit = rng.uniform()
                        kind = (
                            4
                            if style > 0.55 and column % 2 and lit > 0.45
                            else 1
                            if lit < 0.2
                            else 2
                            if lit < 0.36
                            else 3
                            if lit < 0.43
                            else 0
                        )
                    y = 0 if storey == 0 else 0.5 + STOREY * storey
                    # A module looks along +Z and goes on along +X: turned to look across the street.
                    places.append(
                        (side * HOUSES, y + 0.14, z - WIDE * (column + (side > 0)))
                        if side < 0
                        else (HOUSES, y + 0.14, z - WIDE * column - WIDE)
                    )
                    if side < 0:
                        places[-1] = (-HOUSES, y + 0.14, z - WIDE * column)
                    kinds.append(kind)
                    turns.append(90 if side < 0 else -90)
                    colors.append(tint)
            top, end = 0.5 + STOREY * (storeys + 1) + 0.5, z - WIDE * count
            x = sorted((side * (HOUSES + 0.36), side * (HOUSES + 9)))
            solids.append(((x[0], 0, end + 0.01), (x[1], top, z - 0.01)))
            for _ in range(2):
                at = rng.uniform(end + 0.6, z - 1.4)
                out = side * rng.uniform(HOUSES + 1.5, HOUSES + 3)
                solids.append(((out - 0.35, top, at), (out + 0.35, top + rng.uniform(0.9, 1.6), at + 0.9)))
            z = end
    instancer("/street/facades", [f"{base}/{m}" for m in MODULES], kinds, places, turns, colors)
    part("/street/bodies", "stone", *solids, edge=0.02)
    end_wall = [
        ((-16, 0, FAR - 12), (-3.6, 15, FAR - 6)),
        ((-3.4, 0, FAR - 12), (5, 19, FAR - 6)),
        ((5.2, 0, FAR - 12), (16, 13, FAR - 6)),
    ]
    part("/street/end", "stone", *end_wall, edge=0.05)


def ground() -> None:
    part(
        "/street/kerbs",
        "kerb",
        *[
            ((side * KERB - 0.15, 0, z - 1.99), (side * KERB + 0.15, 0.14, z))
            for side in (-1, 1)
            for z in np.arange(NEAR, FAR, -2)
        ],
        edge=0.02,
    )
    slabs = []
    for side in (-1, 1):
        for z in np.arange(NEAR, FAR, -1.0):
            for k in range(4):
                x = sorted((side * (KERB + 0.16 + 0.83 * k), side * (KERB + 0.16 + 0.83 * (k + 1) - 0.008)))
                slabs.append(((x[0], 0, z - 0.992), (x[1], 0.14 + rng.uniform(-0.003, 0.003), z)))
    part("/street/paving", "paving", *slabs, edge=0.006)
    n, m = 41, 200
    x, z = np.meshgrid(np.linspace(-KERB, KERB, n), np.linspace(NEAR + 2, FAR - 6, m), indexing="ij")
    y = 0.05 - 0.05 * (x / KERB) ** 2 + 0.006 * np.sin(1.3 * x + 0.7 * z) * np.sin(0.9 * z - 0.4 * x)
    i, k = np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
    a = (i * m + k).ravel()
    scene.mesh(
        "/street/road",
        np.stack([x, y, z], -1).reshape(-1, 3),
        np.stack([a, a + 1, a + m + 1, a + m], 1),
        "asphalt",
        subdivision="catmullClark",
    )
    pools = []
    for cx, cz, rx, rz in (
        (-1.9, 3.2, 1.5, 2.4),
        (2.1, -0.8, 1.2, 3.3),
        (-2.9, -7.5, 0.9, 4.2),
        (0.9, -13, 1.6, 3.6),
        (-2.2, -24, 1.5, 6),
        (2.6, -29, 1.0, 6),
        (0, -46, 1.6, 8),
    ):
        phi = np.linspace(0, 2 * np.pi, 72, endpoint=False)
        r = 1 + sum(rng.uniform(0.03, 0.16) * np.cos(j * phi + rng.uniform(0, 6.3)) for j in (2, 3, 5, 7))
        rim = np.stack([cx + rx * r * np.cos(phi), np.full(72, 0.056), cz + rz * r * np.sin(phi)], -1)
        pools.append((rim, [list(range(71, -1, -1))]))
    scene.mesh("/street/puddles", *joined(pools), "puddle")
    # The ground under the houses, to the horizon.
    far = np.array([(-300, -0.02, 60), (300, -0.02, 60), (300, -0.02, -400), (-300, -0.02, -400)], float)
    scene.mesh("/street/land", far, [[0, 1, 2, 3]], "asphalt")


def tube(spine: np.ndarray, radii: np.ndarray, around_: int = 8) -> tuple[np.ndarray, np.ndarray]:
    tangent = np.gradient(spine, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, (0.31, 0.2, 0.93))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    phi = 2 * np.pi * np.arange(around_) / around_
    ring = np.cos(phi)[None, :, None] * side[:, None] + np.sin(phi)[None, :, None] * up[:, None]
    points = (spine[:, None] + radii[:, None, None] * ring).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(len(spine) - 1), np.arange(around_), indexing="ij")
    a, b = i * around_ + k, i * around_ + (k + 1) % around_
    return points, np.stack([a, b, b + around_, a + around_], -1).reshape(-1, 4)


def tree(path: str, leaves: int) -> None:
    limbs, tips = [], []

    def grow(start: np.ndarray, way: np.ndarray, long: float, thick: float, level: int) -> None:
        t = np.linspace(0, 1, 6)[:, None]
        bend = rng.normal(0, 0.13 * long, 3)
        spine = start + way * long * t + bend * t * t
        limbs.append(tube(spine, thick * (1 - 0.45 * t[:, 0])))
        if level == 3:
            tips.append(spine)
            return
        for _ in range((4, 4, 4)[level]):
            at = spine[int(rng.integers(3, 6))]
            out = rng.normal(0, 1, 3)
            out -= out @ way * way
            turned = way * rng.uniform(0.55, 0.9) + out / np.linalg.norm(out) * rng.uniform(0.5, 0.9) + (0, 0.16, 0)
            grow(at, turned / np.linalg.norm(turned), long * rng.uniform(0.55, 0.75), thick * 0.5, level + 1)

    grow(np.zeros(3), np.array([0, 1.0, 0]), 2.9, 0.13, 0)
    scene.mesh(f"{path}/wood", *joined(limbs), "bark")
    along = np.concatenate(tips)
    at = along[rng.integers(len(along), size=leaves)] + rng.normal(0, 0.16, (leaves, 3))
    u = rng.normal(0, 1, (leaves, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(u, rng.normal(0, 1, (leaves, 3)))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    size = rng.uniform(0.035, 0.075, (leaves, 1))
    points = np.stack([at - u * size, at + v * size * 0.55, at + u * size, at - v * size * 0.55], 1).reshape(-1, 3)
    scene.mesh(f"{path}/leaves", points, np.arange(leaves * 4).reshape(-1, 4), "leaf")


def lamp(path: str) -> None:
    post = smoothed(
        [(0.16, 0.0), (0.16, 0.25), (0.1, 0.32), (0.065, 0.6), (0.05, 3.6), (0.09, 3.66), (0.05, 3.74), (0.12, 3.82)], 5
    )
    hood = smoothed([(0.24, 4.26), (0.21, 4.34), (0.08, 4.46), (0.03, 4.6), (0.001, 4.62)], 5)
    glow = [(0.1, 3.83), (0.2, 4.24), (0.001, 4.25)]
    scene.mesh(f"{path}/post", *lathe(post, 20), "iron")
    scene.mesh(f"{path}/hood", *lathe(hood, 20), "iron")
    scene.mesh(f"{path}/glow", *lathe(glow, 16), "lamp")


def car(path: str, paint: str) -> None:
    """Along z, 4.2 m long, its tail at +z."""
    outline = [
        (-2.1, 0.38),
        (-2.1, 0.72),
        (-1.95, 0.86),
        (-0.95, 0.98),
        (-0.35, 1.38),
        (0.3, 1.46),
        (1.1, 1.40),
        (1.75, 1.02),
        (2.05, 0.94),
        (2.1, 0.7),
        (2.1, 0.38),
    ]
    z, y = np.array(outline).T
    rings = []
    for x, inset in ((-0.86, 0.06), (-0.80, 0.0), (0.80, 0.0), (0.86, 0.06)):
        narrow = 1 - 0.16 * np.clip((y - 0.95) / 0.5, 0, 1)
        rings.append(np.stack([x * narrow, y - inset * (y > 0.4), z * (1 - 0.02 * (inset > 0))], -1))
    n = len(outline)
    points = np.concatenate(rings)
    faces = [[r * n + k, r * n + (k + 1) % n, (r + 1) * n + (k + 1) % n, (r + 1) * n + k] for r in range(3) for k in range(n)]
    faces += [list(range(n - 1, -1, -1)), list(range(3 * n, 4 * n))]
    scene.mesh(f"{path}/body", points, faces, paint, subdivision="catmullClark")
    back = np.array([(-0.62, 1.33, 1.24), (0.62, 1.33, 1.24), (0.70, 1.06, 1.75), (-0.70, 1.06, 1.75)])
    scene.mesh(f"{path}/rear", back, [[3, 2, 1, 0]], "glass")
    part(
        f"{path}/tails", "tail", *[((s * 0.68 - 0.13, 0.72, 2.02), (s * 0.68 + 0.13, 0.84, 2.085)) for s in (-1, 1)], edge=0.02
    )
    wheels = []
    for x in (-0.80, 0.62):
        for at in (-1.3, 1.35):
            points, quads = lathe(smoothed([(0.2, 0), (0.3, 0.0), (0.33, 0.04), (0.33, 0.15), (0.3, 0.19), (0.2, 0.19)], 3), 24)
            wheels.append((points[:, [1, 0, 2]] @ np.diag([1, 1, 1]) + (x, 0.33, at), quads[:, ::-1]))
    scene.mesh(f"{path}/wheels", *joined(wheels), "tyre")


def things() -> None:
    for k, leaves in enumerate((5200, 4600)):
        tree(f"/modules/tree{k}", leaves)
    lamp("/modules/lamp")
    for name in ("red", "blue", "silver"):
        car(f"/modules/car_{name}", f"car_{name}")
    kinds, places, turns = [], [], []
    for side in (-1, 1):
        for z in np.arange(2.5 if side < 0 else -1.0, FAR, -9.0):
            kinds.append(int(rng.integers(2)))
            places.append((side * (KERB + 0.95), 0.12, z + rng.uniform(-0.4, 0.4)))
            turns.append(rng.uniform(0, 360))
    instancer("/street/trees", ["/modules/tree0", "/modules/tree1"], kinds, places, turns)
    posts = [(side * (KERB + 0.6), 0.14, z) for side in (-1, 1) for z in np.arange(-2.0 if side < 0 else 3.4, FAR, -9.0)]
    instancer("/street/lamps", ["/modules/lamp"], [0] * len(posts), posts)
    cars = [
        (1, 1, 3.4, -3.5),
        (1, 0, 3.35, -9.4),
        (-1, 2, -3.35, -14.5),
        (1, 2, 3.4, -21),
        (-1, 0, -3.4, -29),
        (1, 1, 3.3, -37),
        (-1, 1, -3.35, -41),
    ]
    places = [(x, 0.02, z) for _, _, x, z in cars]
    instancer(
        "/street/cars",
        [f"/modules/car_{n}" for n in ("red", "blue", "silver")],
        [k for _, k, _, _ in cars],
        places,
        [0 if s > 0 else 180 for s, *_ in cars],
    )


wall_material()
houses()
ground()
things()
scene.sky(dusk((1.15, 0.42, 0.12)), "dusk.exr")
scene.save()
