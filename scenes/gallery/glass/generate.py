"""Writes scene.usda and geometry.usdc: glasses in low warm light, and what they make of it. Made for primray; Apache-2.0.

python -m scenes.gallery.glass.generate
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from pxr import Sdf
from scenes.gallery.making import Scene, Triple, inset, lathe, smoothed, turned_body

TYPES = Sdf.ValueTypeNames
AROUND = 48
GAP = 0.0008


def placed(points: np.ndarray, at: Triple) -> np.ndarray:
    return points + np.asarray(at, float)


def wall_of(outer: list[tuple[float, float]]) -> np.ndarray:
    """A blown wall's profile, from the axis to a rim that turns in: a single sheet, thin as light sees it."""
    curve = smoothed(outer, 3)
    return np.concatenate(
        [[(0.0002, outer[0][1])], curve[1:], curve[-1:] + [(-0.0003, 0.0004)], curve[-1:] + [(-0.0008, 0.0002)]]
    )


def filling(outer: list[tuple[float, float]], level: float) -> np.ndarray:
    """A liquid's profile: a gap inside the wall up to its level, with a meniscus, back to the axis."""
    inner = inset(smoothed(outer, 3), GAP)
    side = inner[(inner[:, 1] < level) & (inner[:, 0] > 0.004)]
    radius = np.interp(level, inner[4:, 1], inner[4:, 0])
    rise = 0.0014
    top = [
        (radius, level + rise * 0.7),
        (radius - 0.0004, level + rise),
        (radius - 0.0013, level + rise * 0.6),
        (radius - 0.003, level + rise * 0.12),
        (radius - 0.006, level),
        (radius * 0.5, level),
        (0, level),
    ]
    return np.concatenate([[(0, side[0, 1])], side, top])


def cut_crystal(rings: list[tuple[float, float, int]], sides: int) -> tuple[np.ndarray, list[list[int]]]:
    """Rings (radius, height, half turns of a side), triangles between those that are turned against each other."""
    phi = 2 * np.pi * np.arange(sides) / sides
    points = [
        np.stack([r * np.cos(phi + t * np.pi / sides), np.full(sides, y), r * np.sin(phi + t * np.pi / sides)], 1)
        for r, y, t in rings
    ]
    faces: list[list[int]] = [list(range(sides)), [(len(rings) - 1) * sides + k for k in range(sides)][::-1]]
    for i, ((_, _, t), (_, _, u)) in enumerate(pairwise(rings)):
        low, high = i * sides, (i + 1) * sides
        for k in range(sides):
            n = (k + 1) % sides
            if t == u:
                faces.append([low + k, high + k, high + n, low + n])
            elif u > t:
                faces += [[low + k, high + k, low + n], [high + k, high + n, low + n]]
            else:
                faces += [[low + k, high + k, high + n], [low + k, high + n, low + n]]
    return np.concatenate(points), faces


scene = Scene(__file__, "A still life of glass: wine, a carafe, cut crystal and marbles, and their caustics.")
scene.camera(eye=(0.02, 0.39, 1.1), at=(0.012, 0.085, 0.0), focal_length=62, f_stop=5.6, focus=(-0.05, 0.1, 0.01))

scene.material("glass", transmission_weight=1.0, specular_roughness=0.0, specular_ior=1.5)
scene.material("blown", transmission_weight=1.0, specular_roughness=0.0, specular_ior=1.5, geometry_thin_walled=True)
scene.material(
    "wine",
    transmission_weight=1.0,
    specular_roughness=0.0,
    specular_ior=1.345,
    transmission_color=(0.86, 0.13, 0.13),
    transmission_depth=0.03,
)
scene.material("water", transmission_weight=1.0, specular_roughness=0.0, specular_ior=1.333)
scene.material(
    "crystal",
    transmission_weight=1.0,
    specular_roughness=0.0,
    specular_ior=1.55,
)
for name, color in (("amber", (0.95, 0.5, 0.08)), ("sea", (0.15, 0.62, 0.72)), ("rose", (0.9, 0.3, 0.38))):
    scene.material(
        name,
        transmission_weight=1.0,
        specular_roughness=0.0,
        specular_ior=1.5,
        transmission_color=color,
        transmission_depth=0.02,
    )

# A table of pale ash: long grain along x, and pores.
scene.material("table", base_color=(0.6, 0.5, 0.4), specular_roughness=0.5, specular_weight=0.6)
place = scene.node("table", "place", "position_vector3", TYPES.Vector3f, space="world")
grain = scene.node("table", "along", "multiply_vector3", TYPES.Vector3f, in1=place, in2=(2.2, 1.0, 46.0))
bands = scene.node("table", "bands", "fractal3d_float", TYPES.Float, position=grain, octaves=4, amplitude=0.8)
mixed = scene.node(
    "table",
    "color",
    "mix_color3",
    TYPES.Color3f,
    fg=(0.66, 0.56, 0.44),
    bg=(0.46, 0.35, 0.25),
    mix=scene.node("table", "shade", "remap_float", TYPES.Float, **{"in": bands}, inlow=-0.8, inhigh=0.8),
)
scene.feed("table", base_color=mixed)
scene.material("wall", base_color=(0.1, 0.13, 0.17), specular_weight=0.0)

STEM = [(0, 0), (0.02, 0.0002), (0.0325, 0), (0.0345, 0.0012), (0.033, 0.0026), (0.024, 0.0048), (0.011, 0.0085)]
STEM += [(0.0052, 0.016), (0.0036, 0.03), (0.0034, 0.06), (0.0042, 0.08), (0.007, 0.0876), (0.004, 0.0886), (0, 0.0888)]
BOWL = [
    (0, 0.089),
    (0.0105, 0.0905),
    (0.0235, 0.099),
    (0.0355, 0.114),
    (0.0412, 0.134),
    (0.0408, 0.155),
    (0.0375, 0.18),
    (0.034, 0.2),
]
CARAFE = [
    (0, 0.002),
    (0.03, 0.001),
    (0.046, 0),
    (0.054, 0.004),
    (0.0585, 0.015),
    (0.06, 0.035),
    (0.056, 0.065),
    (0.044, 0.1),
    (0.029, 0.13),
    (0.0205, 0.155),
    (0.0185, 0.18),
    (0.0215, 0.208),
    (0.029, 0.228),
]
for name, at, outer, level, liquid in (
    ("goblet", (-0.085, 0, 0.0), BOWL, 0.14, "wine"),
    ("carafe", (0.115, 0, -0.13), CARAFE, 0.098, "water"),
):
    points, quads = lathe(wall_of(outer), AROUND)
    scene.mesh(f"/life/{name}/glass", placed(points, at), quads, "blown", subdivision="catmullClark")
    points, faces = turned_body(filling(outer, level), AROUND)
    scene.mesh(f"/life/{name}/{liquid}", placed(points, at), faces, liquid, subdivision="catmullClark")
points, faces = turned_body(smoothed(STEM, 3), AROUND)
scene.mesh("/life/goblet/stem", placed(points, (-0.085, 0, 0.0)), faces, "glass", subdivision="catmullClark")

points, faces = cut_crystal(
    [(0.021, 0, 0), (0.035, 0.009, 1), (0.0405, 0.024, 0), (0.0405, 0.027, 0), (0.032, 0.043, 1), (0.019, 0.0515, 0)], 7
)
scene.mesh("/life/crystal", placed(points, (0.085, 0, 0.15)), faces, "crystal")
for name, at, radius in (
    ("amber", (-0.178, 0.105), 0.0225),
    ("sea", (-0.118, 0.137), 0.0155),
    ("rose", (0.205, 0.09), 0.02),
):
    scene.sphere(f"/life/marbles/{name}", (at[0], radius, at[1]), radius, name)

top = np.array([(-1.6, 0, 1.0), (1.6, 0, 1.0), (1.6, 0, -0.55), (-1.6, 0, -0.55)])
scene.mesh("/room/table", top, [[0, 1, 2, 3]], "table")
back = np.array([(-3, -1, -1.6), (3, -1, -1.6), (3, 2.5, -1.6), (-3, 2.5, -1.6)])
scene.mesh("/room/wall", back, [[0, 1, 2, 3]], "wall")

# A low sun behind on the left, a window's cool light from the right, a warm pool on the wall.
scene.ball_light("/lights/sun", (-0.85, 1.15, -1.4), 0.25, 200, (1, 0.72, 0.42))
scene.rect_light("/lights/window", (1.3, 0.9, 0.5), (0, 0.05, 0), (0.7, 1.1), 0.5, (0.62, 0.78, 1))
scene.rect_light("/lights/strip", (-0.9, 0.5, 0.35), (0, 0.1, 0), (0.15, 0.8), 1.2, (1, 0.9, 0.8))
scene.rect_light("/lights/pool", (0.05, -0.25, -1.2), (0.05, 0.1, -1.6), (0.6, 0.2), 22, (1, 0.62, 0.36))
scene.save()
