"""Compared scenes that light at second hand rules, and a colonnade in the sun: many instances, half of it in the shade."""

from __future__ import annotations

import numpy as np

from .scene import Camera, Lamp, Look, Placed, Scene
from .shapes import ball, block, cylinder, rectangle, sky


def ajar() -> Scene:
    """A dark room whose door is ajar: all light is that of the next room's lamp, through a gap of 12 cm."""
    scene = Scene("ajar", (480, 320), 10, Camera((0, 1.5, 3.6), (0.2, 1.2, -1), 62.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.72, 0.7, 0.66)),
        "floor": Look("diffuse", (0.42, 0.3, 0.2)),
        "door": Look("diffuse", (0.5, 0.35, 0.2)),
        "clay": Look("diffuse", (0.6, 0.32, 0.2)),
    }
    # The room is x from -3 to 3, z from -4 to 4; the next one behind it, z from -8 to -4.2.
    scene.add("ground", rectangle((0, 0, -2), (0, 0, 6), (3, 0, 0)), "floor")
    scene.add("ceiling", rectangle((0, 3, -2), (3, 0, 0), (0, 0, 6)), "plaster")
    scene.add("front", rectangle((0, 1.5, 4), (0, 1.5, 0), (3, 0, 0)), "plaster")
    scene.add("behind", rectangle((0, 1.5, -8), (3, 0, 0), (0, 1.5, 0)), "plaster")
    for side in (-1, 1):
        scene.add(f"wall_{side + 1}", rectangle((3.0 * side, 1.5, -2), (0, 1.5, 0), (0, 0, -6.0 * side)), "plaster")
    # The wall between them, about a doorway from x 0.4 to 1.4, and 2.1 high; the door leaves a gap at its left.
    for k, (left, right, low, high) in enumerate([(-3, 0.4, 0, 3), (1.4, 3, 0, 3), (0.4, 1.4, 2.1, 3)]):
        half = ((right - left) / 2, (high - low) / 2, 0.1)
        scene.add(f"between_{k}", block(((left + right) / 2, (low + high) / 2, -4.1), half), "plaster")
    scene.add("door", block((0.96, 1.05, -4.02), (0.44, 1.05, 0.02)), "door")
    scene.add("table", block((-0.8, 0.4, -1.2), (0.8, 0.4, 0.45), 12), "clay")
    scene.add("globe", ball(4, 0.3, (-0.8, 1.1, -1.2), smooth=True), "plaster")
    scene.lamps = [Lamp("rect", (90.0, 80.0, 60.0), (1.6, 2.98, -6.2), (0.3, 0, 0), (0, 0, 0.3))]
    return scene


def attic() -> Scene:
    """A white room with one small window: light that has met its walls a dozen times."""
    scene = Scene("attic", (480, 320), 48, Camera((0, 1.5, 3.6), (0.2, 1.2, -1), 62.0))
    scene.looks = {"white": Look("diffuse", (0.9, 0.9, 0.88)), "blue": Look("diffuse", (0.3, 0.4, 0.7))}
    scene.add("ground", rectangle((0, 0, 0), (0, 0, 4), (3, 0, 0)), "white")
    scene.add("front", rectangle((0, 1.5, 4), (0, 1.5, 0), (3, 0, 0)), "white")
    scene.add("back", rectangle((0, 1.5, -4), (3, 0, 0), (0, 1.5, 0)), "white")
    scene.add("ceiling", rectangle((0, 3, 0), (3, 0, 0), (0, 0, 4)), "white")
    scene.add("right", rectangle((3, 1.5, 0), (0, 1.5, 0), (0, 0, -4)), "white")
    for k, (low, high, far, near) in enumerate([(0, 3, -4, -0.8), (0, 3, -0.2, 4), (0, 1.5, -0.8, -0.2), (2.1, 3, -0.8, -0.2)]):
        scene.add(
            f"left_{k}", block((-3.1, (low + high) / 2, (far + near) / 2), (0.1, (high - low) / 2, (near - far) / 2)), "white"
        )
    scene.add("chest", block((1.2, 0.4, -1.6), (0.7, 0.4, 0.45), -15), "blue")
    scene.images = {"attic_sky.exr": sky(256, (40, 45, 55), (45, 45, 45), (10, 9, 8))}
    scene.lamps = [Lamp("sky", image="attic_sky.exr")]
    return scene


def arcade(bays: int = 24) -> Scene:
    """A colonnade under sun and sky: instances of one column along a gallery with a roof."""
    scene = Scene("arcade", (640, 360), 8, Camera((-1.2, 1.7, 6.5), (1.2, 1.5, -6), 62.0))
    scene.looks = {"stone": Look("diffuse", (0.66, 0.6, 0.5)), "floor": Look("diffuse", (0.5, 0.47, 0.43))}
    scene.add("floor", rectangle((0, 0, -14), (0, 0, 30), (20, 0, 0)), "floor")
    scene.add("wall", block((-2.4, 2.0, -14), (0.2, 2.0, 22)), "stone")
    scene.add("roof", block((-0.6, 4.1, -14), (2.2, 0.15, 22)), "stone")
    scene.meshes["column"] = cylinder((0, 2.0, 0), (0, 2.0, 0), 0.22, 96)
    count = np.arange(bays)
    scene.placed = Placed(
        "column",
        "stone",
        np.stack([np.full(bays, 1.2), np.zeros(bays), 4.0 - 1.6 * count], axis=1).astype(np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float16), (bays, 1)),
        np.ones(bays, np.float32),
    )
    scene.images = {"arcade_sky.exr": sky(256, (0.26, 0.46, 0.9), (0.9, 0.95, 1.0), (0.3, 0.3, 0.3))}
    scene.lamps = [Lamp("sky", image="arcade_sky.exr"), Lamp("sun", (3.0, 2.8, 2.4), direction=(-0.7, -0.6, -0.3))]
    return scene
