"""A compared scene of hair: strands that hang over a ball, as cubic B-splines, under a sky."""

from __future__ import annotations

import numpy as np

from .scene import Camera, Lamp, Look, Scene, Strands
from .shapes import Array, ball, rectangle, sky

HAIR = Look("hair", (0.12, 0.28, 0.6), 0.3, 1.55)  # the colour: what is absorbed over a radius


def groom(name: str = "groom", count: int = 25_000, radius: float = 0.0025) -> Scene:
    """A ball of fur on a table; the strands bend down and a little at random."""
    scene = Scene(name, (400, 400), 24, Camera((0, 1.5, 3.6), (0, 0.75, 0), 34.0))
    scene.looks = {"hair": HAIR, "skin": Look("diffuse", (0.2, 0.12, 0.08)), "table": Look("diffuse", (0.5, 0.48, 0.45))}
    scene.add("table", rectangle((0, 0, 0), (0, 0, 4), (4, 0, 0)), "table")
    scene.add("skin", ball(5, 0.6, (0, 0.75, 0), smooth=True), "skin")
    scene.strands = Strands(_strands(count), radius, "hair")
    disc = ((0.4, 0.7, 0.5), 6.0, (60.0, 55.0, 46.0))
    scene.images = {f"{name}_sky.exr": sky(512, (0.25, 0.4, 0.8), (0.8, 0.86, 1.0), (0.2, 0.18, 0.16), disc)}
    scene.lamps = [Lamp("sky", image=f"{name}_sky.exr")]
    return scene


def pelt() -> Scene:
    """The same with a million strands a sixth of a pixel wide."""
    return groom("pelt", 1_000_000, 0.0005)


def _strands(count: int) -> Array:
    """(N, 7, 3): control points of uniform cubic B-splines; the first three stand close, so that each begins near the skin."""
    rng = np.random.default_rng(12)
    out = rng.normal(size=(count, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    side = rng.normal(size=(count, 3)) * 0.05
    points = [np.array([0, 0.75, 0]) + out * (0.6 - 0.02), np.array([0, 0.75, 0]) + out * 0.6]
    way, step = out.copy(), 0.055 * rng.uniform(0.7, 1.3, (count, 1))
    for _ in range(5):
        points.append(points[-1] + way * step)
        way = way + np.array([0, -0.28, 0]) + side
        way /= np.linalg.norm(way, axis=1, keepdims=True)
    return np.stack(points, axis=1)
