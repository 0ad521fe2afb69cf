"""The compared scenes in which something moves while the shutter is open; terms: scene.py.

Everything is straight, or turns at a constant rate, between opening and closing, so that it means the same to renderers that
know two times or many.
"""

from __future__ import annotations

import numpy as np

from .scene import Camera, Glide, Lamp, Look, Pan, Placed, Scene
from .shapes import Triangles, ball, block, bumps, rectangle, sky


def spin() -> Scene:
    """Blocks that turn and slide under a small lamp that moves: a mesh, since not every renderer's lights can."""
    scene = Scene("spin", (240, 160), 4, Camera((0, 1.7, 5.2), (0, 0.7, 0), 48.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.7, 0.68, 0.64)),
        "clay": Look("diffuse", (0.6, 0.32, 0.2)),
        "blue": Look("diffuse", (0.15, 0.25, 0.55)),
        "glow": Look("glow", (900.0, 780.0, 600.0)),
    }
    scene.add("floor", rectangle((0, 0, 0), (0, 0, 6), (6, 0, 0)), "plaster")
    scene.add("wall", rectangle((0, 3, -2.5), (6, 0, 0), (0, 3, 0)), "plaster")
    scene.add("bar", block((0, 0, 0), (0.9, 0.12, 0.12)), "clay")
    scene.add("cube", block((0, 0, 0), (0.35, 0.35, 0.35)), "blue")
    scene.add("post", block((1.5, 0.7, -0.8), (0.15, 0.7, 0.15)), "plaster")
    scene.add("lamp", ball(3, 0.06), "glow")
    scene.glides = {
        "bar": Glide((-0.5, 0.75, 0.3), turn_deg=70.0),
        "cube": Glide((0.9, 0.36, 0.9), (0.7, 0.0, 0.25), 40.0),
        "lamp": Glide((0.3, 3.2, 1.4), (1.2, 0.0, -0.5)),
    }
    return scene


def pan() -> Scene:
    """A camera that pans and drives over a field of coloured tiles and blocks, under sun and sky. Tiles, not images: renderers
    filter these in their own ways."""
    scene = Scene("pan", (240, 160), 3, Camera((0, 2.2, 9.0), (0, 1.0, 0), 54.0))
    scene.pan = Pan((0, 2.2, 9.0), 10.0, (0.35, 0.0, -0.2), 5.0)
    colors = ((0.62, 0.58, 0.52), (0.25, 0.2, 0.18), (0.5, 0.16, 0.1), (0.12, 0.28, 0.42))
    scene.looks = {f"tile_{k}": Look("diffuse", color) for k, color in enumerate(colors)}
    scene.looks["block"] = Look("diffuse", (0.66, 0.64, 0.6))
    rng = np.random.default_rng(51)
    kinds = rng.integers(0, len(colors), (120, 120))
    for kind in range(len(colors)):
        scene.add(f"tiles_{kind}", _tiles(kinds == kind), f"tile_{kind}")
    for k in range(24):
        half = (0.2, float(rng.uniform(0.3, 1.1)), 0.2)
        at = ((k % 6 - 2.5) * 2.2 + rng.uniform(-0.5, 0.5), half[1], 4.0 - (k // 6) * 3.0 + rng.uniform(-0.8, 0.8))
        scene.add(f"block_{k}", block(at, half, float(rng.uniform(0, 90))), "block")
    scene.images = {"pan_sky.exr": sky(256, (0.26, 0.46, 0.9), (0.9, 0.95, 1.0), (0.3, 0.3, 0.3))}
    scene.lamps = [Lamp("sky", image="pan_sky.exr"), Lamp("sun", (2.5, 2.3, 2.0), direction=(-0.5, -0.7, -0.4))]
    return scene


def _tiles(where: np.ndarray, size: float = 0.4) -> Triangles:  # type: ignore[type-arg]
    """Squares of the ground of that size, about the origin."""
    x, z = ((np.stack(np.nonzero(where)) - where.shape[0] / 2) * size)[:, :, None]
    corners_x, corners_z = x + np.array([0, 0, size, size]), z + np.array([0, size, size, 0])
    points = np.stack([corners_x, np.zeros_like(corners_x), corners_z], axis=-1).reshape(-1, 3)
    first = np.arange(len(x))[:, None] * 4
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]).astype(np.int32)
    return Triangles(points, faces)


def swarm(count: int = 4000, swarms: int = 64) -> Scene:
    """Many instances of one small mesh that fly in swarms, each its own way, over a ground under sun and sky."""
    scene = Scene("swarm", (240, 160), 3, Camera((0, 5, 15), (0, 1.2, 0), 50.0))
    scene.looks = {"ground": Look("diffuse", (0.38, 0.37, 0.35)), "stone": Look("diffuse", (0.66, 0.38, 0.22))}
    scene.add("ground", rectangle((0, 0, 0), (0, 0, 60), (60, 0, 0)), "ground")
    stone = ball(3)
    height = 1 + 0.9 * bumps(stone.points, 3, 3.5, 21)
    scene.meshes["stone"] = Triangles(stone.points * height[:, None], stone.faces)
    rng = np.random.default_rng(52)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    scene.placed = Placed(
        "stone",
        "stone",
        rng.uniform((-9, 0.3, -9), (9, 3.0, 9), (count, 3)).astype(np.float32),
        quaternions.astype(np.float16),
        rng.uniform(0.08, 0.16, count).astype(np.float32),
        rng.integers(0, swarms, count).astype(np.int32),
        rng.normal(size=(swarms, 3)) * (0.3, 0.1, 0.3),
    )
    scene.images = {"swarm_sky.exr": sky(256, (0.26, 0.46, 0.9), (0.9, 0.95, 1.0), (0.3, 0.3, 0.3))}
    scene.lamps = [Lamp("sky", image="swarm_sky.exr"), Lamp("sun", (2.5, 2.3, 2.0), direction=(-0.5, -0.7, -0.4))]
    return scene


def flag(side: int = 121) -> Scene:
    """A sheet that waves over a ground, under a sky alone."""
    scene = Scene("flag", (240, 160), 4, Camera((0, 1.5, 5.5), (0, 1.1, 0), 46.0))
    scene.looks = {"ground": Look("diffuse", (0.45, 0.43, 0.4)), "cloth": Look("diffuse", (0.62, 0.14, 0.12))}
    scene.add("ground", rectangle((0, 0, 0), (0, 0, 20), (20, 0, 0)), "ground")
    x, y = np.meshgrid(np.linspace(-1.6, 1.6, side), np.linspace(0.3, 2.1, side), indexing="xy")
    k = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + side], axis=1), np.stack([k + 1, k + side + 1, k + side], axis=1)])

    def waving(phase: float) -> np.ndarray:  # type: ignore[type-arg]
        loose = (x + 1.6) / 3.2
        z = 0.45 * loose * np.sin(4 * x + 1.5 * y - phase)
        return np.stack([x - 0.1 * loose * np.cos(phase), y, z], axis=-1).reshape(-1, 3)

    scene.add("cloth", Triangles(waving(0.0), faces.astype(np.int32)), "cloth")
    scene.ends = {"cloth": waving(0.9)}
    scene.images = {"flag_sky.exr": sky(256, (0.3, 0.5, 1.0), (1.0, 0.9, 0.76), (0.2, 0.2, 0.2))}
    scene.lamps = [Lamp("sky", image="flag_sky.exr")]
    return scene
