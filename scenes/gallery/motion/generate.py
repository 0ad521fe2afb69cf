"""Writes scene.usda, geometry.usdc and dusk.exr: a wheel of lamps by a lake, in a second's exposure.

Made for primray; Apache-2.0.

python -m scenes.gallery.motion.generate
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, UsdGeom
from scenes.gallery.making import Scene, dusk, joined, lathe, rounded_box

rng = np.random.default_rng(3)
HUB, RADIUS, CABINS = (3.0, 13.2, -30.0), 10.5, 16
TURN = 6.0  # degrees while the shutter is open
BULBS = {"amber": (1.0, 0.56, 0.2), "rose": (1.0, 0.2, 0.26), "cyan": (0.25, 0.72, 1.0)}

scene = Scene(
    __file__, "A wheel of lamps turns for a second while its stand, the pier and the far shore keep still.", frames=(1, 1)
)
scene.stage.SetTimeCodesPerSecond(1)
camera = scene.camera(eye=(-5.0, 2.6, 9.0), at=(0.6, 7.7, -30), focal_length=25)
camera.CreateShutterOpenAttr(0.0)
camera.CreateShutterCloseAttr(1.0)

scene.material("steel", base_color=(0.34, 0.35, 0.38), specular_roughness=0.4, base_metalness=0.6)
scene.material("white", base_color=(0.55, 0.54, 0.52), specular_roughness=0.4)
scene.material("wood", base_color=(0.12, 0.075, 0.045), specular_roughness=0.5)
scene.material("land", base_color=(0.012, 0.016, 0.014), specular_weight=0.0)
scene.material("water", base_color=(0.004, 0.008, 0.012), specular_roughness=0.015)
for name, tint in (
    ("red", (0.5, 0.05, 0.03)),
    ("blue", (0.03, 0.13, 0.36)),
    ("yellow", (0.6, 0.36, 0.05)),
    ("green", (0.04, 0.26, 0.16)),
):
    scene.material(name, base_color=tint, specular_roughness=0.25, coat_weight=1.0)
for name, color in BULBS.items():
    scene.material(name, base_color=(0.0, 0.0, 0.0), specular_weight=0.0, emission_color=color, emission_luminance=95.0)
scene.material(
    "lantern", base_color=(0.0, 0.0, 0.0), specular_weight=0.0, emission_color=(1.0, 0.66, 0.34), emission_luminance=11.0
)
scene.material(
    "window", base_color=(0.0, 0.0, 0.0), specular_weight=0.0, emission_color=(1.0, 0.62, 0.3), emission_luminance=1.6
)


def rod(a: np.ndarray, b: np.ndarray, thick: float) -> tuple[np.ndarray, np.ndarray]:
    """A square bar from a to b."""
    along = (b - a) / np.linalg.norm(b - a)
    side = np.cross(along, (0, 0, 1) if abs(along[2]) < 0.9 else (0, 1, 0))
    side *= thick / np.linalg.norm(side)
    up = np.cross(along, side)
    corners = [side + up, -side + up, -side - up, side - up]
    points = np.array([end + c for end in (a, b) for c in corners])
    faces = [[0, 1, 2, 3][::-1], [4, 5, 6, 7]] + [[k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    return points, np.array(faces)


def spun(path: str, at: tuple[float, float, float], turn: float) -> UsdGeom.Xform:
    made = UsdGeom.Xform.Define(scene.stage, path)
    made.AddTranslateOp().Set(Gf.Vec3d(*at))
    op = made.AddRotateZOp()
    op.Set(0.0, 1)
    op.Set(turn, 2)
    return made


def rim(angle: float, radius: float, z: float = 0.0) -> np.ndarray:
    return np.array([radius * np.cos(angle), radius * np.sin(angle), z])


def wheel() -> None:
    spun("/wheel", HUB, TURN)
    bars = []
    around = 2 * np.pi * np.arange(48) / 48
    for z in (-0.8, 0.8):
        for r in (RADIUS, 0.72 * RADIUS):
            bars += [rod(rim(a, r, z), rim(b, r, z), 0.05) for a, b in zip(around, np.roll(around, -1), strict=True)]
        bars += [rod(rim(a, 0.5, z), rim(a, RADIUS, z), 0.035) for a in around[::3]]
    bars += [rod(rim(a, RADIUS, -0.8), rim(a, RADIUS, 0.8), 0.035) for a in around[::3]]
    scene.mesh("/wheel/frame", *joined(bars), "white")
    hub, faces = lathe([(0.001, -1.3), (0.5, -1.3), (0.7, -1.1), (0.7, 1.1), (0.5, 1.3), (0.001, 1.3)], 32)
    scene.mesh("/wheel/hub", hub[:, [0, 2, 1]], faces[:, ::-1], "steel")
    bulb, faces = lathe([(0.0001, -1), (0.7, -0.7), (1, 0), (0.7, 0.7), (0.0001, 1)], 8)
    groups: dict[str, list] = {name: [] for name in BULBS}
    for k, a in enumerate(around):
        groups["amber"].append((bulb * 0.085 + rim(a, RADIUS + 0.12, 0.86), faces))
        if k % 3 == 0:
            groups["rose"] += [(bulb * 0.07 + rim(a, r * RADIUS, 0.88), faces) for r in (0.2, 0.34, 0.48)]
            groups["cyan"] += [(bulb * 0.07 + rim(a + np.pi / 48 * 3, 0.72 * RADIUS, 0.88), faces)]
    for name, parts in groups.items():
        scene.mesh(f"/wheel/{name}", *joined(parts), name)
    for k in range(CABINS):
        a = 2 * np.pi * k / CABINS
        path = f"/wheel/cabin{k}"
        spun(path, tuple(rim(a, RADIUS)), -TURN)  # hangs upright
        paint = ("red", "yellow", "green", "blue")[k % 4]
        scene.mesh(f"{path}/box", *rounded_box((-0.62, -1.75, -0.6), (0.62, -1.0, 0.6), 0.12), paint)
        scene.mesh(f"{path}/roof", *rounded_box((-0.7, -0.42, -0.66), (0.7, -0.28, 0.66), 0.06), paint)
        posts = [rod(np.array([x, -1.0, z]), np.array([x, -0.4, z]), 0.03) for x in (-0.55, 0.55) for z in (-0.52, 0.52)]
        posts += [rod(np.array([0, -0.3, 0]), np.array([0, 0, 0]), 0.05)]
        scene.mesh(f"{path}/posts", *joined(posts), "steel")


def stand() -> None:
    hub = np.array(HUB)
    legs = [rod(hub + (0, 0, z), np.array([HUB[0] + x, 0.6, HUB[2] + z * 1.8]), 0.2) for z in (-1.5, 1.5) for x in (-4.6, 4.6)]
    legs += [
        rod(np.array([HUB[0] - 2.6, 6.1, HUB[2] + z * 1.45]), np.array([HUB[0] + 2.6, 6.1, HUB[2] + z * 1.45]), 0.1)
        for z in (-1.5, 1.5)
    ]
    scene.mesh("/stand/legs", *joined(legs), "steel")
    deck = [((x, 0.5, HUB[2] - 5), (x + 0.28, 0.62, HUB[2] + 6)) for x in np.arange(-9.0, 16.0, 0.3)]
    scene.mesh("/stand/deck", *joined([rounded_box(a, b, 0.015) for a, b in deck]), "wood")
    piles = [
        rod(np.array([x, -1, z]), np.array([x, 0.5, z]), 0.14)
        for x in np.arange(-8.6, 16, 2.7)
        for z in (HUB[2] + 5.6, HUB[2] + 1)
    ]
    piles += [rod(np.array([-9, 0.42, HUB[2] + 5.7]), np.array([16, 0.42, HUB[2] + 5.7]), 0.09)]
    scene.mesh("/stand/piles", *joined(piles), "wood")
    posts, lights = [], []
    bulb, faces = lathe([(0.0001, -1), (0.7, -0.7), (1, 0), (0.7, 0.7), (0.0001, 1)], 12)
    for x in np.arange(-8.6, 16, 2.7):
        posts += [rod(np.array([x, 0.6, HUB[2] + 5.7]), np.array([x, 3.0, HUB[2] + 5.7]), 0.045)]
        lights += [(bulb * 0.17 + (x, 3.15, HUB[2] + 5.7), faces)]
    rail = [rod(np.array([-9, y, HUB[2] + 5.7]), np.array([16, y, HUB[2] + 5.7]), 0.03) for y in (1.1, 1.5)]
    scene.mesh("/stand/posts", *joined([*posts, *rail]), "steel")
    scene.mesh("/stand/lanterns", *joined(lights), "lantern")
    booth = [rounded_box((-7.0, 0.62, -33), (-3.4, 3.0, -30.2), 0.05)]
    scene.mesh("/stand/booth", *joined(booth), "white")
    roof = np.array([(-7.4, 3.0, -33.4), (-3.0, 3.0, -33.4), (-3.0, 3.0, -29.8), (-7.4, 3.0, -29.8), (-5.2, 4.3, -31.6)])
    scene.mesh("/stand/roof", roof, [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [3, 2, 1, 0]], "red")
    pane = np.array([(-6.5, 1.5, -30.18), (-3.9, 1.5, -30.18), (-3.9, 2.6, -30.18), (-6.5, 2.6, -30.18)])
    scene.mesh("/stand/pane", pane, [[0, 1, 2, 3]], "window")


def lake() -> None:
    """Finer near the camera; waves of a few lengths."""
    n, m = 170, 260
    s = np.linspace(0, 1, m)
    z = 7 - 230 * s**2.6 - 14 * s
    x = np.linspace(-1, 1, n)[:, None] * (9 + 0.75 * (7 - z))[None, :]
    z = np.repeat(z[None], n, 0)
    y = np.zeros_like(x)
    for k in range(16):
        length, turn = 0.35 * 1.32**k * 0.9, rng.uniform(0, 2 * np.pi)
        spacing = np.abs(np.gradient(z, axis=1))
        w = 2 * np.pi / length
        y += (
            0.0042
            * length**0.75
            * np.clip(1.3 - 3.2 * spacing / length, 0, 1)
            * np.sin(w * (np.cos(turn) * x + np.sin(turn) * z) + rng.uniform(0, 6.3))
        )
    i, k = np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
    a = (i * m + k).ravel()
    points = np.stack([x, y, z], -1).reshape(-1, 3)
    scene.mesh("/lake/water", points, np.stack([a, a + m, a + m + 1, a + 1], 1), "water", subdivision="catmullClark")
    along = np.linspace(-260, 260, 180)
    ridge = 5 + 9 * np.abs(np.sin(along * 0.013 + 1)) + 3 * np.sin(along * 0.07) + rng.uniform(0, 1.1, 180)
    shore = np.stack(
        [np.stack([along, np.full(180, -0.5), np.full(180, -190.0)], 1), np.stack([along, ridge, np.full(180, -205.0)], 1)]
    )
    i = np.arange(179)
    scene.mesh("/lake/shore", shore.reshape(-1, 3), np.stack([i, i + 1, i + 181, i + 180], 1), "land")
    specks = []
    for _ in range(70):
        x0, y0 = rng.uniform(-160, 160), rng.uniform(0.4, 3.2)
        d = rng.uniform(0.14, 0.3)
        specks.append(
            (
                np.array([(x0 - d, y0 - d, -189), (x0 + d, y0 - d, -189), (x0 + d, y0 + d, -189), (x0 - d, y0 + d, -189)]),
                [[0, 1, 2, 3]],
            )
        )
    scene.mesh("/lake/town", *joined(specks), "lantern")


wheel()
stand()
lake()
scene.sky(dusk((0.75, 0.22, 0.16)), "dusk.exr")
scene.save()
