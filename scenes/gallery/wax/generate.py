"""Writes scene.usda and geometry.usdc: candles, jade and milk glass by night. Made for primray; Apache-2.0.

python -m scenes.gallery.wax.generate
"""

from __future__ import annotations

import numpy as np
from pxr import Sdf
from scenes.gallery.making import Scene, Triple, inset, lathe, smoothed, tube, turned_body

TYPES = Sdf.ValueTypeNames


def body(path: str, profile: np.ndarray, around: int, at: Triple, material: str, bend: float = 0, seed: int = 0) -> None:
    """A closed body of turning, whose rings are uneven by `bend` where it is not 0."""
    points, faces = turned_body(profile, around)
    if bend:
        own = np.random.default_rng(seed)
        phi = np.arctan2(points[:, 2], points[:, 0])
        wave = sum(
            own.normal() * np.sin(k * phi + own.uniform(0, 6.3) + 14 * points[:, 1] * own.normal()) / k for k in (2, 3, 5)
        )
        points[:, [0, 2]] *= (1 + bend * wave)[:, None]
    scene.mesh(path, points + np.asarray(at), faces, material, subdivision="catmullClark")


def candle(name: str, at: Triple, radius: float, height: float, seed: int, drips: int) -> None:
    """A pillar with drips and a pool burnt into it, a wick and a flame."""
    own = np.random.default_rng(seed)
    r, h = radius, height
    wall = [(r, y) for y in np.linspace(0.006, h - 0.008, 14)]
    side = [
        (0, 0.0),
        (r * 0.8, 0),
        (r * 0.97, 0.001),
        *wall,
        (r, h - 0.003),
        (r * 0.98, h),
        (r * 0.93, h + 0.0015),
        (r * 0.86, h - 0.001),
        (r * 0.78, h - 0.008),
        (r * 0.6, h - 0.0115),
        (r * 0.25, h - 0.012),
        (0, h - 0.012),
    ]
    points, faces = turned_body(smoothed(side, 2), 96)
    phi, y = np.arctan2(points[:, 2], points[:, 0]), points[:, 1]
    across = np.hypot(points[:, 0], points[:, 2])
    more = sum(0.0012 * own.normal() * np.sin(k * phi + own.uniform(0, 6.3) + 9 * y * own.normal()) / k for k in (2, 3, 5))
    lower = 0.004 * (np.sin(phi + own.uniform(0, 6.3)) + 0.5 * np.sin(3 * phi + own.uniform(0, 6.3)))
    for _ in range(drips):
        start, long, thick = own.uniform(0, 2 * np.pi), h * own.uniform(0.2, 0.8), own.uniform(0.75, 1.2)
        lean = start + 0.2 * np.sin((h - y) / h * own.uniform(2, 5))
        off = (phi - lean + np.pi) % (2 * np.pi) - np.pi
        t = (h - y) / long
        bulb = np.exp(-(((t - 0.9) / (0.006 / long)) ** 2) / 2)
        wide = 0.0024 * thick * (0.85 + 0.5 * bulb) / r
        more = more + 0.0038 * thick * (0.8 + 0.6 * bulb) * np.exp(-((off / wide) ** 2)) * np.clip((1.02 - t) * 9, 0, 1)
    points[:, [0, 2]] *= (1 + more * (across > 0.7 * r) / r)[:, None]
    points[:, 1] += lower * np.clip((y - h * 0.7) / (h * 0.3), 0, 1) ** 2 * (across / r) ** 2
    scene.mesh(f"/life/{name}/wax", points + np.asarray(at), faces, "wax", subdivision="catmullClark")
    foot = np.asarray(at) + [0, h - 0.0125, 0]
    wick = smoothed([(0, 0, 0), (0.0002, 0.005, 0), (0.0012, 0.0095, 0.0004), (0.0032, 0.0125, 0.0008)], 5)
    points, faces = tube(wick + foot, 0.0009, 8)
    scene.mesh(f"/life/{name}/wick", points, faces, "wick", subdivision="catmullClark")
    shape = smoothed(
        [(0, 0), (0.0028, 0.0022), (0.0047, 0.008), (0.0046, 0.014), (0.0030, 0.022), (0.0012, 0.030), (0, 0.037)], 3
    )
    points, faces = turned_body(shape * [0.92, 1.0], 20)
    points[:, 0] += 0.06 * points[:, 1] * np.sin(seed)
    scene.mesh(f"/life/{name}/flame", points + foot + [0.0008, 0.0065, 0], faces, "flame", subdivision="catmullClark")


scene = Scene(__file__, "Candles, a jade bowl and figure, and a lamp of milk glass, by night.")
scene.camera(eye=(0.03, 0.2, 0.86), at=(0.012, 0.09, 0), focal_length=62, f_stop=4, focus=(-0.03, 0.08, 0.02))

scene.material(
    "wax",
    base_color=(0.9, 0.8, 0.62),
    subsurface_weight=1.0,
    subsurface_color=(0.93, 0.78, 0.55),
    subsurface_radius=0.016,
    subsurface_radius_scale=(1.0, 0.55, 0.28),
    specular_roughness=0.38,
)
scene.material(
    "jade",
    base_color=(0.2, 0.5, 0.3),
    subsurface_weight=1.0,
    subsurface_color=(0.38, 0.76, 0.52),
    subsurface_radius=0.013,
    subsurface_radius_scale=(0.5, 1.0, 0.7),
    specular_roughness=0.16,
    coat_weight=0.6,
    coat_roughness=0.08,
)
scene.material(
    "milk",
    base_color=(0.9, 0.9, 0.88),
    subsurface_weight=1.0,
    subsurface_color=(0.85, 0.83, 0.8),
    subsurface_radius=0.012,
    specular_roughness=0.12,
)
scene.material("wood", base_color=(0.07, 0.03, 0.018), specular_roughness=0.3, coat_weight=0.5, coat_roughness=0.15)
scene.material("wick", base_color=(0.015, 0.012, 0.01), specular_weight=0.0)
scene.material(
    "flame", base_color=(0.0, 0.0, 0.0), specular_weight=0.0, emission_luminance=34.0, emission_color=(1.0, 0.5, 0.14)
)
scene.material("brass", base_color=(0.75, 0.5, 0.22), base_metalness=1.0, specular_roughness=0.28)
scene.material("wall", base_color=(0.1, 0.12, 0.16), specular_weight=0.0)

# Dark walnut: long grain.
scene.material("table", base_color=(0.1, 0.06, 0.04), specular_roughness=0.33, coat_weight=0.25, coat_roughness=0.2)
place = scene.node("table", "place", "position_vector3", TYPES.Vector3f, space="world")
grain = scene.node("table", "along", "multiply_vector3", TYPES.Vector3f, in1=place, in2=(3.0, 1.0, 55.0))
bands = scene.node("table", "bands", "fractal3d_float", TYPES.Float, position=grain, octaves=4, amplitude=0.8)
shade = scene.node("table", "shade", "remap_float", TYPES.Float, **{"in": bands}, inlow=-0.8, inhigh=0.8)
mixed = scene.node("table", "color", "mix_color3", TYPES.Color3f, fg=(0.3, 0.17, 0.1), bg=(0.12, 0.066, 0.04), mix=shade)
scene.feed("table", base_color=mixed)

candle("tall", (-0.105, 0, -0.01), 0.031, 0.125, 3, 7)
candle("middle", (-0.035, 0, -0.065), 0.027, 0.165, 8, 6)
candle("low", (-0.052, 0, 0.062), 0.034, 0.058, 14, 5)

# A lobed bowl of jade, with pearls of milk glass in it.
BOWL = np.array([0.125, 0, 0.095])
outer = 0.8 * smoothed([(0, 0), (0.018, 0), (0.02, 0.002), (0.018, 0.006), (0.03, 0.013), (0.047, 0.025), (0.055, 0.037)], 3)
inner = inset(outer, 0.0036)[6:][::-1]
inner = inner[inner[:, 1] > 0.0105]
rim = [outer[-1] + (-0.001, 0.0018), outer[-1] + (-0.0026, 0.0016)]
profile = np.concatenate([outer, rim, inner, [(0.008, 0.0088), (0, 0.0085)]])
points, faces = turned_body(profile, 64)
phi = np.arctan2(points[:, 2], points[:, 0])
points[:, [0, 2]] *= (1 + 0.075 * np.clip(points[:, 1] / 0.033, 0, 1) ** 2 * np.abs(np.cos(phi * 4)) ** 0.7)[:, None]
scene.mesh("/life/bowl", points + BOWL, faces, "jade", subdivision="catmullClark")
PEARL = 0.0098
for k, (x, y, z) in enumerate(
    ((-0.0102, 0.019, 0), (0.0102, 0.0192, -0.003), (0.001, 0.0196, 0.0172), (-0.001, 0.0342, 0.0058))
):
    scene.sphere(f"/life/pearls/pearl{k}", (BOWL[0] + x, BOWL[1] + y, BOWL[2] + z), PEARL, "milk")
scene.sphere("/life/pearls/astray", (0.062, PEARL, 0.128), PEARL, "milk")

# A disc of jade (bi) with bosses in rings, upright in a foot of wood.
loop = smoothed([(0.0145, 0), (0.0155, 0.0042), (0.019, 0.0046), (0.038, 0.0046), (0.0415, 0.0042), (0.0425, 0)], 5)[:-1]
loop = np.concatenate([loop, loop[::-1] * [1, -1]])
loop = np.concatenate([loop[:-1][np.r_[True, np.linalg.norm(np.diff(loop[:-1], axis=0), axis=1) > 1e-9]]])
around, rows = 160, len(loop)
points, _ = lathe(loop, around)
faces = np.array(
    [
        [i * around + k, i * around + (k + 1) % around, (i + 1) % rows * around + (k + 1) % around, (i + 1) % rows * around + k]
        for i in range(rows)
        for k in range(around)
    ]
)[:, ::-1]
across, phi = np.hypot(points[:, 0], points[:, 2]), np.arctan2(points[:, 2], points[:, 0])
raised = np.zeros(len(points))
for radius, count in ((0.0225, 16), (0.0285, 20), (0.0345, 24)):
    off = (phi * count / (2 * np.pi) + 0.5 * (radius == 0.0285)) % 1 - 0.5
    raised += np.exp(-((across - radius) ** 2 + (off * 2 * np.pi * radius / count) ** 2) / 0.0014**2)
points[:, 1] += 0.0026 * raised * np.sign(points[:, 1])
DISC = np.array([0.038, 0.0515, 0.03])
c, n = np.cos(0.3), np.sin(0.3)
points = np.stack([points[:, 0], points[:, 2], points[:, 1]], 1)[:, :] * [1, 1, 1]
scene.mesh(
    "/life/disc",
    points @ np.array([[c, 0, n], [0, 1, 0], [-n, 0, c]]) + DISC,
    faces,
    "jade",
    subdivision="catmullClark",
)
foot = smoothed(
    [(0, 0), (0.02, 0), (0.0235, 0.001), (0.024, 0.004), (0.022, 0.0075), (0.017, 0.0105), (0.0125, 0.0135), (0, 0.014)], 2
)
points, faces = turned_body(foot, 32)
points = points * [1.05, 1, 0.6] @ np.array([[c, 0, n], [0, 1, 0], [-n, 0, c]])
scene.mesh("/life/foot", points + DISC * [1, 0, 1], faces, "wood", subdivision="catmullClark")

# A lamp: a globe of milk glass on brass, lit from within.
GLOBE, R = (0.13, 0.134, -0.095), 0.048
t = np.linspace(-np.pi / 2 + 0.42, np.pi / 2, 15)
outside = np.stack([R * np.cos(t), R * np.sin(t)], 1)
inside = outside[::-1] * ((R - 0.0035) / R)
neck = np.array([(outside[0, 0] * 0.98, outside[0, 1] - 0.002), (inside[-1, 0] * 0.98, outside[0, 1] - 0.002)])
shell = np.concatenate([outside, inside[1:], neck[::-1]])
points, faces = lathe(
    np.concatenate([outside[:-1], [(0.0006, R)], [(0.0006, R - 0.0035)], inside[1:], neck[::-1], neck[:0]]), 40
)
n, rows = 40, len(points) // 40
close = np.array([[(rows - 1) * n + k, k, (k + 1) % n, (rows - 1) * n + (k + 1) % n] for k in range(n)])
scene.mesh("/life/lamp/globe", points + GLOBE, np.concatenate([faces, close]), "milk", subdivision="catmullClark")
stem = smoothed(
    [
        (0, 0),
        (0.03, 0),
        (0.036, 0.001),
        (0.037, 0.004),
        (0.033, 0.008),
        (0.014, 0.013),
        (0.007, 0.022),
        (0.0055, 0.045),
        (0.0075, 0.056),
        (0.0055, 0.064),
        (0.009, 0.075),
        (0.02, 0.082),
        (0.0225, 0.086),
        (0.021, 0.089),
        (0.012, 0.09),
        (0, 0.09),
    ],
    2,
)
body("/life/lamp/stem", stem, 32, (GLOBE[0], 0, GLOBE[2]), "brass")
scene.ball_light("/lights/globe", (GLOBE[0], GLOBE[1] - 0.002, GLOBE[2]), 0.016, 14, (1, 0.83, 0.62))

top = np.array([(-1.6, 0, 0.8), (1.6, 0, 0.8), (1.6, 0, -0.5), (-1.6, 0, -0.5)])
scene.mesh("/room/table", top, [[0, 1, 2, 3]], "table")
back = np.array([(-3, -1, -1.2), (3, -1, -1.2), (3, 2.5, -1.2), (-3, 2.5, -1.2)])
scene.mesh("/room/wall", back, [[0, 1, 2, 3]], "wall")

scene.rect_light("/lights/moon", (-0.9, 0.75, -0.55), (0, 0.08, 0), (0.5, 0.5), 10.0, (0.4, 0.6, 1))
scene.rect_light("/lights/hearth", (0.62, 0.3, -0.4), (0.06, 0.05, 0.03), (0.25, 0.25), 45.0, (1, 0.62, 0.34))
scene.rect_light("/lights/haze", (-0.2, -0.2, -0.8), (-0.1, 0.2, -1.2), (0.8, 0.2), 3.0, (0.35, 0.5, 1))
scene.rect_light("/lights/fill", (0.9, 0.6, 0.9), (0, 0.05, 0), (0.9, 0.9), 0.6, (0.6, 0.75, 1))
scene.save()
