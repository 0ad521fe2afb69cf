"""Compared scenes that light behind glass and water rules: its own way is a chain of refractions."""

from __future__ import annotations

import numpy as np

from .scene import Camera, Lamp, Look, Scene
from .shapes import Triangles, ball, block, rectangle, tube

POOL_SIDE, POOL_DEPTH, GAP = 4.0, 0.5, 0.01


def pool(cells: int = 64) -> Scene:
    """Waves over tiles under a small lamp, seen through the water, whose body ends a centimetre above the tiles."""
    scene = Scene("pool", (480, 270), 12, Camera((0, 2.6, 4.2), (0, 0.3, 0), 73.7))
    scene.looks = {"water": Look("glass", ior=1.33), "tile": Look("diffuse", (0.7, 0.65, 0.6))}
    scene.add("floor", rectangle((0, 0, 0), (0, 0, 3), (3, 0, 0)), "tile")
    scene.add("wall", rectangle((0, 2, -3), (3, 0, 0), (0, 2, 0)), "tile")
    scene.add("water", _water(cells), "water")
    scene.lamps = [Lamp("ball", (4000.0, 4000.0, 4000.0), (0.3, 2.0, 0.2), radius=0.05)]
    return scene


def _water(cells: int) -> Triangles:
    """A closed body: waves above, a flat bottom, straight sides; its normals are those of the waves only on top."""
    at = np.linspace(-POOL_SIDE / 2, POOL_SIDE / 2, cells + 1)
    x, z = (grid.ravel() for grid in np.meshgrid(at, at, indexing="xy"))
    ripples = ((0.02, 5.0, 0.0, 1.0), (0.015, 0.5, 7.0, 0.0), (0.01, 11.0, 11.0, 0.0))
    height = POOL_DEPTH + sum(a * np.sin(u * x + v * z + p) for a, u, v, p in ripples)
    slope_x = sum(a * u * np.cos(u * x + v * z + p) for a, u, v, p in ripples)
    slope_z = sum(a * v * np.cos(u * x + v * z + p) for a, u, v, p in ripples)
    top = np.stack([x, height, z], axis=1)
    up = np.stack([-slope_x, np.ones_like(x), -slope_z], axis=1)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    bottom = np.stack([x, np.full_like(x, GAP), z], axis=1)
    k = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    quads = np.stack([k, k + cells + 1, k + cells + 2, k + 1], axis=1)
    points, normals, faces = [top, bottom], [up, np.tile([0.0, -1.0, 0.0], (len(x), 1))], [quads, quads[:, ::-1] + len(x)]
    row = np.arange(cells + 1)
    sides = (
        (row, (0, 0, -1)),
        (row[::-1] * (cells + 1), (-1, 0, 0)),
        (row[::-1] + cells * (cells + 1), (0, 0, 1)),
        (row * (cells + 1) + cells, (1, 0, 0)),
    )
    for edge, out in sides:
        first, n = sum(len(part) for part in points), cells + 1
        points += [top[edge], bottom[edge]]
        normals.append(np.tile(np.array(out, float), (2 * n, 1)))
        j = first + np.arange(cells)
        faces.append(np.stack([j, j + 1, j + n + 1, j + n], axis=1))
    every = np.concatenate(faces)
    triangles = np.concatenate([every[:, [0, 1, 2]], every[:, [0, 2, 3]]]).astype(np.int32)
    return Triangles(np.concatenate(points), triangles, np.concatenate(normals))


def bulbs() -> Scene:
    """Three small lamps in hollow globes of glass before a wall: all light comes through two walls of glass."""
    scene = Scene("bulbs", (480, 270), 10, Camera((0, 1.5, 4.0), (0, 0.9, 0), 73.7))
    scene.looks = {"glass": Look("glass", ior=1.5), "plaster": Look("diffuse", (0.7, 0.7, 0.7))}
    scene.add("floor", rectangle((0, 0, 0), (0, 0, 3), (3, 0, 0)), "plaster")
    scene.add("back", rectangle((0, 2, -1.5), (3, 0, 0), (0, 2, 0)), "plaster")
    for k, x in enumerate((-1.0, 0.0, 1.0)):
        scene.add(f"outside_{k}", ball(6, 0.2, (x, 1.2, 0), smooth=True), "glass")
        scene.add(f"inside_{k}", _inside_out(ball(6, 0.19, (x, 1.2, 0), smooth=True)), "glass")
        scene.lamps.append(Lamp("ball", (3000.0, 2800.0, 2500.0), (x, 1.2, 0.0), radius=0.025))
    return scene


def _inside_out(shape: Triangles) -> Triangles:
    assert shape.normals is not None
    return Triangles(shape.points, np.ascontiguousarray(shape.faces[:, ::-1]), -shape.normals)


def junk(count: int = 220) -> Scene:
    """A heap of things of metal, glass and paint under three lamps: many surfaces, and a few caustics."""
    scene = Scene("junk", (480, 320), 8, Camera((0, 3.2, 5.6), (0, 0.5, 0), 52.0))
    rng = np.random.default_rng(61)
    scene.looks = {"floor": Look("plastic", (0.45, 0.42, 0.38), 0.6), "glass": Look("glass", ior=1.5)}
    for k in range(40):
        color = tuple(float(c) for c in rng.uniform(0.05, 0.85, 3))
        scene.looks[f"paint_{k}"] = Look("plastic", color, float(rng.uniform(0.1, 0.6)))  # type: ignore[arg-type]
    for k in range(10):
        color = tuple(float(c) for c in rng.uniform(0.5, 0.98, 3))
        scene.looks[f"metal_{k}"] = Look("metal", color, float(rng.uniform(0.12, 0.5)))  # type: ignore[arg-type]
    scene.add("floor", rectangle((0, 0, 0), (0, 0, 8), (8, 0, 0)), "floor")
    scene.add("wall", rectangle((0, 3, -4), (8, 0, 0), (0, 3, 0)), "floor")
    for k in range(count):
        size = float(rng.uniform(0.09, 0.22))
        across = 2.4 * np.sqrt(rng.uniform())
        turn = rng.uniform(0, 2 * np.pi)
        at = (float(1.2 * across * np.cos(turn)), size + float(rng.uniform(0, 0.5) * (k % 3)), float(across * np.sin(turn)))
        kind = rng.uniform()
        look = "glass" if kind < 0.06 else f"metal_{k % 10}" if kind < 0.3 else f"paint_{k % 40}"
        scene.add(f"thing_{k}", _thing(k, size, at, rng), look)
    for x, z, radiance in ((-2.2, 1.5, (22.0, 20.0, 16.0)), (2.4, 0.6, (14.0, 16.0, 20.0)), (0.2, -2.4, (18.0, 12.0, 10.0))):
        scene.lamps.append(Lamp("rect", radiance, (x, 4.0, z), (0.3, 0, 0), (0, 0, 0.3)))
    return scene


def _thing(number: int, size: float, at: tuple[float, float, float], rng: np.random.Generator) -> Triangles:
    if number % 3 == 0:
        return ball(4, size, at, smooth=True)
    if number % 3 == 1:
        return block(
            at, (size, size * float(rng.uniform(0.4, 1.0)), size * float(rng.uniform(0.4, 1.0))), float(rng.uniform(0, 90))
        )
    around = np.linspace(0.0, 2 * np.pi, 32, endpoint=False)
    ring = np.stack([size * np.cos(around) + at[0], size * np.sin(around) + at[1], np.full(32, at[2])], axis=1)
    return tube(ring, 0.3 * size, 12, closed=True)
