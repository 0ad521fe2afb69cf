"""Writes scene.usda and geometry.usdc: a reading corner, afternoon sun through two tall windows. Made for primray; Apache-2.0.

python -m scenes.gallery.interior.generate
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, UsdLux
from scenes.gallery.making import Scene, joined, lathe, looking, rounded_box, smoothed, turned

rng = np.random.default_rng(5)
LEFT, RIGHT, BACK, FRONT, HIGH = -2.6, 2.5, -2.3, 3.9, 2.75
WINDOWS = [(-1.75, -0.6), (0.1, 1.25)]  # along z
SILL, HEAD = 0.12, 2.4

scene = Scene(__file__, "A reading corner, lit by afternoon sun and sky through two tall windows.")
scene.camera(eye=(1.35, 1.32, 3.35), at=(-0.62, 0.98, -1.2), focal_length=27)

scene.material("plaster", base_color=(0.80, 0.77, 0.71), specular_weight=0.0)
scene.material("back", base_color=(0.17, 0.29, 0.28), specular_weight=0.0)
scene.material("paint", base_color=(0.82, 0.80, 0.76), specular_roughness=0.45)
for k, tint in enumerate(((0.36, 0.20, 0.10), (0.42, 0.25, 0.13), (0.31, 0.17, 0.085), (0.45, 0.28, 0.15), (0.38, 0.22, 0.12))):
    scene.material(f"oak{k}", base_color=tint, specular_roughness=0.42)
scene.material("walnut", base_color=(0.16, 0.08, 0.04), specular_roughness=0.38)
scene.material("leather", base_color=(0.42, 0.16, 0.06), specular_roughness=0.5)
scene.material("brass", base_color=(0.88, 0.66, 0.32), base_metalness=1.0, specular_roughness=0.3)
scene.material("clay", base_color=(0.75, 0.68, 0.60), specular_roughness=0.6)
scene.material(
    "wool", base_color=(0.72, 0.66, 0.55), specular_weight=0.0, fuzz_weight=0.3, fuzz_color=(0.9, 0.85, 0.8), fuzz_roughness=0.6
)
scene.material("stripe", base_color=(0.45, 0.12, 0.07), specular_weight=0.0)
scene.material("leaf", base_color=(0.10, 0.20, 0.06), specular_roughness=0.5)
scene.material(
    "linen",
    base_color=(0.85, 0.82, 0.75),
    specular_weight=0.0,
    subsurface_weight=0.6,
    subsurface_color=(0.95, 0.9, 0.8),
    geometry_thin_walled=True,
)
scene.material("lawn", base_color=(0.07, 0.12, 0.03), specular_weight=0.0)
scene.material("foliage", base_color=(0.06, 0.11, 0.03), specular_weight=0.0)
scene.material("paper", base_color=(0.78, 0.74, 0.66), specular_weight=0.0)
scene.material("ink", base_color=(0.12, 0.2, 0.33), specular_weight=0.0)
BOOKS = [
    (0.45, 0.07, 0.05),
    (0.08, 0.14, 0.28),
    (0.70, 0.52, 0.20),
    (0.10, 0.22, 0.14),
    (0.62, 0.58, 0.50),
    (0.30, 0.10, 0.16),
    (0.05, 0.05, 0.06),
]
for k, tint in enumerate(BOOKS):
    scene.material(f"book{k}", base_color=tint, specular_roughness=0.55)


def solid(
    name: str, material: str, *boxes: tuple[tuple[float, float, float], tuple[float, float, float]], edge: float = 0.004
) -> None:
    scene.mesh(f"/room/{name}", *joined([rounded_box(low, high, edge) for low, high in boxes]), material)


def room() -> None:
    thick = 0.28
    walls = [((LEFT - thick, 0, BACK - 0.2), (LEFT, SILL, FRONT)), ((LEFT - thick, HEAD, BACK - 0.2), (LEFT, HIGH, FRONT))]
    edges = [BACK - 0.2, *(edge for window in WINDOWS for edge in window), FRONT]
    walls += [((LEFT - thick, SILL, a), (LEFT, HEAD, b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    walls += [
        ((RIGHT, 0, BACK - 0.2), (RIGHT + 0.2, HIGH, FRONT)),
        ((LEFT - thick, 0, FRONT), (RIGHT + 0.2, HIGH, FRONT + 0.2)),
    ]
    walls += [((LEFT - thick, HIGH, BACK - 0.2), (RIGHT + 0.2, HIGH + 0.2, FRONT + 0.2))]
    solid("walls", "plaster", *walls, edge=0.001)
    solid("back", "back", ((LEFT, 0, BACK - 0.2), (RIGHT, HIGH, BACK)), edge=0.001)
    solid(
        "skirting",
        "paint",
        ((LEFT, 0, BACK), (RIGHT, 0.13, BACK + 0.02)),
        ((RIGHT - 0.02, 0, BACK + 0.02), (RIGHT, 0.13, FRONT)),
    )
    solid("cornice", "paint", ((LEFT, HIGH - 0.09, BACK), (RIGHT, HIGH, BACK + 0.06)), edge=0.012)
    solid("ground", "walnut", ((LEFT - thick, -0.2, BACK - 0.2), (RIGHT + 0.2, -0.031, FRONT + 0.2)))
    planks: dict[int, list] = {k: [] for k in range(5)}
    for x in np.arange(LEFT - 0.3, RIGHT + 0.2, 0.135):
        z = BACK - 0.2 - rng.uniform(0, 1.4)
        while z < FRONT:
            long = rng.uniform(0.9, 1.7)
            planks[int(rng.integers(5))].append(((x + 0.001, -0.03, z + 0.001), (x + 0.134, 0.0, z + long - 0.001)))
            z += long
    for k, these in planks.items():
        solid(f"planks{k}", f"oak{k}", *these, edge=0.0015)
    frames = []
    for a, b in WINDOWS:
        x, w = LEFT - 0.16, 0.05
        frames += [((x, SILL, z), (x + 0.06, HEAD, z + w)) for z in (a, (a + b - w) / 2, b - w)]
        frames += [((x + 0.005, y, a + w), (x + 0.055, y + 0.035, b - w)) for y in (SILL, 0.72, 1.25, 1.78, HEAD - 0.035)]
        frames += [((LEFT - 0.02, SILL - 0.035, a - 0.06), (LEFT + 0.07, SILL, b + 0.06))]
        frames += [((LEFT, SILL, z), (LEFT + 0.02, HEAD + 0.08, z + 0.08)) for z in (a - 0.08, b)]
        frames += [((LEFT, HEAD, a - 0.08), (LEFT + 0.02, HEAD + 0.08, b + 0.08))]
    solid("frames", "paint", *frames)


def garden() -> None:
    """What the windows show: a lawn, a hedge and the trees behind it."""
    lawn = np.array([(-60, -0.35, -60), (LEFT - 0.3, -0.35, -60), (LEFT - 0.3, -0.35, 60), (-60, -0.35, 60)])
    scene.mesh("/garden/lawn", lawn, [[0, 3, 2, 1]], "lawn")
    leaves = []
    for _ in range(2600):
        at = np.array([-11 + rng.normal(0, 0.35), rng.uniform(-0.3, 1.25), rng.uniform(-14, 9)])
        leaves.append(at)
    for x, z, tall, wide in ((-16, -9.5, 5.2, 2.2), (-14, -2.5, 4.2, 1.7), (-19, 3.0, 6.0, 2.6)):
        way = rng.normal(0, 1, (2600, 3))
        way *= (rng.uniform(0.3, 1, 2600) ** 0.4 / np.linalg.norm(way, axis=1))[:, None]
        leaves += list(np.array([x, tall, z]) + way * (wide, 1.25 * wide, wide))
        trunk, faces = lathe([(0.22, -0.4), (0.16, tall - wide)], 10)
        scene.mesh(f"/garden/trunk{int(-x)}", trunk + (x, 0, z), faces, "walnut")
    at = np.array(leaves)
    u, v = (rng.normal(0, 1, at.shape) for _ in range(2))
    u, v = (w / np.linalg.norm(w, axis=1, keepdims=True) * rng.uniform(0.07, 0.15, (len(at), 1)) for w in (u, v))
    points = np.stack([at - u, at + v * 0.6, at + u, at - v * 0.6], 1).reshape(-1, 3)
    scene.mesh("/garden/leaves", points, np.arange(len(points)).reshape(-1, 4), "foliage")


def curtain(name: str, low: float, high: float) -> None:
    """Folds of linen along z, narrower above."""
    u, v = np.meshgrid(np.linspace(0, 1, 120), np.linspace(0, 1, 24), indexing="ij")
    fold = np.sin(u * 2 * np.pi * 6.5 + 0.6 * np.sin(5 * v)) * (0.035 + 0.02 * (1 - v))
    z = low + (high - low) * (u + 0.02 * np.sin(9 * u + 3 * v))
    points = np.stack([LEFT + 0.11 + fold, 0.02 + v * 2.5, z], -1).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(119), np.arange(23), indexing="ij")
    a = (i * 24 + k).ravel()
    scene.mesh(f"/room/{name}", points, np.stack([a, a + 1, a + 25, a + 24], 1), "linen", subdivision="catmullClark")


def shelf() -> None:
    left, right, front = -0.15, 2.1, BACK + 0.31
    rows = (0.13, 0.55, 0.93, 1.31, 1.69)
    boards = [((left, y - 0.028, BACK + 0.02), (right, y, front)) for y in (*rows, 2.08)]
    boards += [((x - 0.014, 0.0, BACK + 0.02), (x + 0.014, 2.08, front)) for x in (left, (left + right) / 2, right)]
    solid("shelf", "walnut", *boards, edge=0.003)
    books: dict[int, list] = {k: [] for k in range(len(BOOKS))}
    for y, above in zip(rows, (*rows[1:], 2.08), strict=True):
        for bay in range(2):
            x, end = (left, (left + right) / 2)[bay] + 0.025, ((left + right) / 2, right)[bay] - 0.03
            end -= rng.choice([0.0, 0.15, 0.42])
            while x < end - 0.05:
                wide, tall = rng.uniform(0.018, 0.05), rng.uniform(0.62, 0.93) * (above - y - 0.03)
                out = front - rng.uniform(0.015, 0.05)
                books[int(rng.integers(len(BOOKS)))].append(((x, y, out - rng.uniform(0.16, 0.2)), (x + wide, y + tall, out)))
                x += wide + 0.001
    for k, these in books.items():
        solid(f"books{k}", f"book{k}", *these, edge=0.003)
    vase = smoothed(
        [(0.001, 0), (0.055, 0.0), (0.085, 0.06), (0.07, 0.14), (0.028, 0.2), (0.034, 0.23), (0.026, 0.228), (0.022, 0.2)], 8
    )
    for k, (x, y, size) in enumerate(((0.83, rows[2], 1.0), (1.98, rows[3], 0.85), (0.86, rows[4], 1.1))):
        points, faces = lathe(vase * size, 48)
        scene.mesh(
            f"/room/vase{k}",
            points + (x - 0.02, y, BACK + 0.17),
            faces,
            "clay" if k != 1 else "brass",
            subdivision="catmullClark",
        )


def chair() -> None:
    """A leather chair on wooden runners, turned to the light."""
    place, degrees = (-0.75, 0, -0.65), -38

    def part(name: str, material: str, low: tuple, high: tuple, edge: float, tilt: float = 0, soft: bool = False) -> None:
        points, faces = rounded_box(low, high, edge)
        c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
        pivot = np.array([0, 0.36, -0.3])
        points = (points - pivot) @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) + pivot
        scene.mesh(
            f"/room/chair/{name}",
            turned(points, degrees, place),
            faces,
            material,
            subdivision="catmullClark" if soft else "none",
        )

    part("seat", "leather", (-0.34, 0.27, -0.36), (0.34, 0.47, 0.42), 0.05, -6, True)
    part("rest", "leather", (-0.34, 0.44, -0.42), (0.34, 1.02, -0.22), 0.05, -17, True)
    part("head", "leather", (-0.30, 0.96, -0.40), (0.30, 1.16, -0.25), 0.045, -17, True)
    for side in (-1, 1):
        x = 0.39 * side
        part(f"arm{side + 1}", "walnut", (x - 0.035, 0.60, -0.42), (x + 0.035, 0.635, 0.38), 0.012)
        for z in (-0.36, 0.33):
            part(f"leg{side + 1}{int(z > 0)}", "walnut", (x - 0.022, 0.0, z - 0.022), (x + 0.022, 0.60, z + 0.022), 0.008)
        part(f"rail{side + 1}", "walnut", (x - 0.018, 0.24, -0.36), (x + 0.018, 0.30, 0.33), 0.008)
    part("beam", "walnut", (-0.38, 0.24, 0.31), (0.38, 0.29, 0.35), 0.008)
    part("beam_back", "walnut", (-0.38, 0.24, -0.38), (0.38, 0.29, -0.34), 0.008)
    part("cushion", "wool", (-0.21, 0.50, -0.26), (0.21, 0.86, -0.10), 0.07, -22, True)


def table() -> None:
    x, z = 0.42, -0.35
    top = smoothed([(0.001, 0.50), (0.28, 0.50), (0.30, 0.51), (0.30, 0.525), (0.285, 0.535), (0.001, 0.535)], 3)
    foot = smoothed([(0.2, 0.0), (0.2, 0.012), (0.05, 0.03), (0.022, 0.08), (0.02, 0.44), (0.06, 0.50)], 6)
    for name, profile, material in (("top", top, "walnut"), ("foot", foot, "brass")):
        points, faces = lathe(profile, 64)
        scene.mesh(
            f"/room/table/{name}", points + (x, 0, z), faces, material, subdivision="none" if name == "top" else "catmullClark"
        )
    cup = smoothed([(0.001, 0.0), (0.026, 0.0), (0.04, 0.03), (0.042, 0.075), (0.038, 0.075), (0.036, 0.03), (0.001, 0.012)], 5)
    points, faces = lathe(cup, 40)
    scene.mesh("/room/table/cup", points + (x - 0.12, 0.536, z + 0.08), faces, "clay", subdivision="catmullClark")
    for k, (material, size) in enumerate((("book1", 0.11), ("book2", 0.1))):
        points, faces = rounded_box((-size, 0, -size * 0.72), (size, 0.028, size * 0.72), 0.003)
        scene.mesh(
            f"/room/table/book{k}", turned(points, 25 + 22 * k, (x + 0.1, 0.536 + 0.0285 * k, z - 0.04)), faces, material
        )


def rug() -> None:
    low, high = (-1.75, 0.001, -1.35), (1.15, 0.014, 0.75)
    solid("rug", "wool", (low, high), edge=0.004)
    bands = [
        ((low[0] + 0.02, 0.008, z), (high[0] - 0.02, 0.0155, z + w))
        for z, w in ((-1.24, 0.05), (-1.14, 0.02), (0.5, 0.02), (0.57, 0.05))
    ]
    solid("bands", "stripe", *bands, edge=0.002)


def plant() -> None:
    x, z = -2.1, -1.95
    pot = smoothed([(0.001, 0.0), (0.13, 0.0), (0.17, 0.16), (0.18, 0.33), (0.165, 0.335), (0.15, 0.28), (0.001, 0.28)], 6)
    points, faces = lathe(pot, 48)
    scene.mesh("/room/plant/pot", points + (x, 0, z), faces, "clay", subdivision="catmullClark")
    leaves = []
    for k in range(46):
        turn, lean, long = 2.4 * k, rng.uniform(0.15, 1.05), rng.uniform(0.45, 0.95)
        out, side = np.array([np.cos(turn), 0, np.sin(turn)]), np.array([-np.sin(turn), 0, np.cos(turn)])
        t = np.linspace(0, 1, 9)[:, None]
        spine = (
            np.array([x, 0.28, z])
            + out * (0.04 + lean * long * t**1.6)
            + np.array([0, 1, 0]) * long * (1.25 * t - 0.5 * lean * t**2.4)
        )
        wide = 0.055 * np.sin(np.pi * np.clip(t, 0.02, 0.995)) ** 0.8
        crease = np.array([0, 0.35, 0]) * wide
        points = np.stack([spine - side * wide + crease, spine, spine + side * wide + crease], 1).reshape(-1, 3)
        i, j = np.meshgrid(np.arange(8), np.arange(2), indexing="ij")
        a = (i * 3 + j).ravel()
        leaves.append((points, np.stack([a, a + 1, a + 4, a + 3], 1)))
    scene.mesh("/room/plant/leaves", *joined(leaves), "leaf", subdivision="catmullClark")


def picture() -> None:
    x, y, wide, tall = -1.0, 1.62, 0.5, 0.66
    solid("frame", "walnut", ((x - wide / 2, y - tall / 2, BACK), (x + wide / 2, y + tall / 2, BACK + 0.03)))
    solid(
        "mat",
        "paper",
        ((x - wide / 2 + 0.02, y - tall / 2 + 0.02, BACK + 0.01), (x + wide / 2 - 0.02, y + tall / 2 - 0.02, BACK + 0.0315)),
        edge=0.001,
    )
    disc, faces = lathe([(0.11, 0.0), (0.001, 0.0)], 64)
    disc = disc[:, [0, 2, 1]]
    scene.mesh("/room/sun", disc + (x + 0.02, y + 0.08, BACK + 0.0325), faces[:, ::-1], "stripe")
    solid("sea", "ink", ((x - 0.19, y - 0.24, BACK + 0.02), (x + 0.19, y - 0.06, BACK + 0.033)), edge=0.0005)


def lights() -> None:
    sun = UsdLux.DistantLight.Define(scene.stage, "/lights/sun")
    sun.CreateAngleAttr(0.8)
    sun.CreateNormalizeAttr(True)
    sun.CreateIntensityAttr(75)
    sun.CreateColorAttr(Gf.Vec3f(1, 0.76, 0.5))
    sun.AddTransformOp().Set(looking((0, 0, 0), (0.80, -0.47, 0.30)))
    sky = UsdLux.DomeLight.Define(scene.stage, "/lights/sky")
    sky.CreateColorAttr(Gf.Vec3f(0.55, 0.75, 1.0))
    sky.CreateIntensityAttr(4.5)
    portals = []
    for k, (a, b) in enumerate(WINDOWS):
        portal = UsdLux.PortalLight.Define(scene.stage, f"/lights/window{k}")
        portal.CreateWidthAttr(b - a)
        portal.CreateHeightAttr(HEAD - SILL)
        middle = (LEFT - 0.2, (SILL + HEAD) / 2, (a + b) / 2)
        portal.AddTransformOp().Set(looking(middle, (middle[0] + 1, *middle[1:])))
        portals.append(portal.GetPath())
    sky.CreatePortalsRel().SetTargets(portals)


room()
garden()
curtain("curtain0", -0.62, -0.12)
curtain("curtain1", 1.2, 1.7)
shelf()
chair()
table()
rug()
plant()
picture()
lights()
scene.save()
