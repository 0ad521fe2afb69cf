"""Compared scenes of surfaces with many lobes: OpenPBR's, Cycles' Principled, Mitsuba's principled."""

from __future__ import annotations

from .scene import Camera, Lamp, Layered, Look, Scene
from .shapes import ball, rectangle

SHELF = (
    Layered("layered", (0.75, 0.4, 0.25), 0.7),
    Layered("layered", (0.05, 0.3, 0.65), 0.15),
    Layered("layered", (1.0, 0.78, 0.34), 0.15, metalness=1.0),
    Layered("layered", (0.95, 0.64, 0.54), 0.4, metalness=1.0),
    Layered("layered", (0.6, 0.6, 0.65), 0.3, metalness=0.5),
    Layered("layered", (0.6, 0.02, 0.02), 0.5, coat=1.0),
    Layered("layered", (0.2, 0.45, 0.25), 0.4, metalness=1.0, coat=1.0),
    Layered("layered", (0.25, 0.03, 0.2), 0.8, fuzz=0.8),
    Layered("layered", (0.95, 0.97, 0.95), 0.25, transmission=1.0),
    Layered("layered", (0.9, 0.95, 1.0), 0.1, transmission=1.0),
    Layered("layered", (0.8, 0.5, 0.3), 0.4, transmission=0.5),
    Layered("layered", (0.05, 0.05, 0.05), 0.25),
)


def shelf() -> Scene:
    """Twelve balls, each of another surface, on a table under two large lamps, in a sky."""
    scene = Scene("shelf", (480, 320), 8, Camera((0, 2.4, 4.2), (0, 0.35, 0), 50.0))
    scene.looks = {f"l{k}": look for k, look in enumerate(SHELF)} | {"table": Look("diffuse", (0.5, 0.47, 0.42))}
    scene.add("table", rectangle((0, 0, 0), (4, 0, 0), (0, 0, -4)), "table")
    scene.add("wall", rectangle((0, 2, -3), (4, 0, 0), (0, 2, 0)), "table")
    for k in range(len(SHELF)):
        scene.add(f"ball_{k}", ball(5, 0.28, ((k % 6 - 2.5) * 0.66, 0.28, 0.45 - 0.9 * (k // 6)), smooth=True), f"l{k}")
    for x, radiance in ((-1.6, (9.0, 8.0, 6.5)), (1.6, (5.0, 6.0, 8.0))):
        scene.lamps.append(Lamp("rect", radiance, (x, 3.0, 0.6), (0.5, 0, 0), (0, 0, 0.5)))
    return scene


def flesh() -> Scene:
    """Balls of skin, wax and jade, as random walks below their surfaces, under one lamp from behind and one from before."""
    scene = Scene("flesh", (480, 320), 64, Camera((0, 1.2, 3.2), (0, 0.4, 0), 40.0))
    scene.looks = {
        "skin": Layered("layered", (0.85, 0.55, 0.45), 0.5, subsurface=1.0, radius=(0.1, 0.04, 0.02)),
        "wax": Layered("layered", (0.9, 0.8, 0.6), 0.4, subsurface=1.0, radius=(0.2, 0.16, 0.1)),
        "jade": Layered("layered", (0.4, 0.7, 0.45), 0.3, subsurface=1.0, radius=(0.06, 0.12, 0.06)),
        "table": Look("diffuse", (0.4, 0.4, 0.4)),
    }
    scene.add("table", rectangle((0, 0, 0), (4, 0, 0), (0, 0, -4)), "table")
    for k, name in enumerate(("skin", "wax", "jade")):
        scene.add(name, ball(5, 0.4, ((k - 1) * 0.9, 0.4, 0), smooth=True), name)
    scene.lamps += [
        Lamp("rect", (14.0, 13.0, 12.0), (0, 1.6, -2.2), (0.4, 0, 0), (0, 0.28, 0.28)),
        Lamp("rect", (4.0, 4.0, 4.5), (1.5, 2.4, 1.5), (0.4, 0, 0), (0, 0, 0.4)),
    ]
    return scene
