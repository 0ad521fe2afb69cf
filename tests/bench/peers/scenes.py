"""The compared scenes, in terms that every renderer has. Add one here and it is written and rendered for all.

What they mean: y up, metres, linear Rec.709, a pinhole camera, box filter one pixel wide, nothing clamped, nothing denoised.
depth: surface scatterings (1 = direct light). diffuse: Lambert. metal: GGX, alpha = roughness squared, Schlick's Fresnel from
the colour to 1. plastic: a diffuse base under GGX with the Fresnel term of an index of refraction of 1.5, as each renderer
has it. glass: a smooth dielectric. glow: the colour is the radiance it emits, it reflects nothing; meshes of it are closed or
have something black behind them, as renderers differ in what backs emit. ember: the same, in USD by the surface's material
where a glow is a light of its own. layered: metal, dielectric and glass under a smooth coat and fuzz, all of an index of 1.5,
as OpenPBR, Cycles' Principled and Mitsuba's principled have them; subsurface: a random walk. hair: Chiang et
al. 2016, both roughnesses alike, scales that are not tilted. rect, disc, tube and ball: the
radiance they emit; the rect, and the disc inscribed in it, to one side (u x v); the tube, along u, from its lateral area, with
something black at its ends. sun: without extent, its irradiance. sky: a latitude-longitude image (shapes.sky).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from .dim_rooms import ajar, arcade, attic
from .glass_scenes import bulbs, junk, pool
from .grooms import groom, pelt
from .moving_scenes import flag, pan, spin, swarm
from .scene import Camera, Lamp, Look, Placed, Rgb, Scene
from .shapes import Triangles, ball, block, bumps, cylinder, rectangle, sky, terrain, tube
from .surfaces import flesh, shelf


def box() -> Scene:
    """An indoor scene: much light arrives over several bounces."""
    scene = Scene("box", (512, 512), 8, Camera((0, 1, 3.8), (0, 1, 0), 40.0))
    scene.looks = {
        "white": Look("diffuse", (0.74, 0.73, 0.7)),
        "red": Look("diffuse", (0.6, 0.06, 0.05)),
        "green": Look("diffuse", (0.13, 0.46, 0.1)),
        "black": Look("diffuse", (0.0, 0.0, 0.0)),
    }
    scene.add("floor", rectangle((0, 0, 0), (0, 0, 1), (1, 0, 0)), "white")
    scene.add("ceiling", rectangle((0, 2, 0), (1, 0, 0), (0, 0, 1)), "white")
    scene.add("back", rectangle((0, 1, -1), (1, 0, 0), (0, 1, 0)), "white")
    scene.add("left", rectangle((-1, 1, 0), (0, 1, 0), (0, 0, 1)), "red")
    scene.add("right", rectangle((1, 1, 0), (0, 0, 1), (0, 1, 0)), "green")
    scene.add("tall", block((-0.35, 0.62, -0.3), (0.29, 0.62, 0.29), 18), "white")
    scene.add("short", block((0.34, 0.29, 0.35), (0.29, 0.29, 0.29), -16), "white")
    # Renderers differ in whether a lamp shades what is behind it; behind this one nothing is lit or seen.
    scene.add("lamp_back", rectangle((0, 1.985, 0), (0.24, 0, 0), (0, 0, 0.2)), "black")
    scene.lamps = [Lamp("rect", (17.0, 12.5, 5.0), (0, 1.98, 0), (0.24, 0, 0), (0, 0, 0.2))]
    return scene


def field_of_stones(count: int = 100_000) -> Scene:
    """Many instances of one small mesh under sun and sky."""
    scene = Scene("field", (640, 360), 4, Camera((0, 9, 38), (0, 0, 4), 56.0))
    scene.looks = {"ground": Look("diffuse", (0.38, 0.37, 0.35)), "stone": Look("diffuse", (0.66, 0.38, 0.22))}
    scene.add("ground", rectangle((0, 0, 0), (0, 0, 240), (240, 0, 0)), "ground")
    stone = ball(4)
    height = 1 + 0.9 * bumps(stone.points, 3, 3.5, 21)
    scene.meshes["stone"] = Triangles(stone.points * height[:, None], stone.faces)
    rng = np.random.default_rng(22)
    side = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), side)
    scales = rng.uniform(0.16, 0.3, count)
    grid = (np.stack([row, column], axis=1) - (side - 1) / 2) * 0.8 + rng.uniform(-0.1, 0.1, (count, 2))
    positions = np.stack([grid[:, 0], 0.85 * scales, grid[:, 1]], axis=1)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    scene.placed = Placed(
        "stone", "stone", positions.astype(np.float32), quaternions.astype(np.float16), scales.astype(np.float32)
    )
    scene.images = {"field_sky.exr": sky(256, (0.26, 0.46, 0.9), (0.9, 0.95, 1.0), (0.3, 0.3, 0.3))}
    scene.lamps = [Lamp("sky", image="field_sky.exr"), Lamp("sun", (2.5, 2.3, 2.0), direction=(-0.5, -0.7, -0.4))]
    return scene


def hills(side: int = 1001) -> Scene:
    """One mesh of two million triangles under a sky."""
    scene = Scene("hills", (640, 360), 3, Camera((0, 5.2, 9.2), (0, -0.3, 0), 50.0))
    scene.looks = {"rock": Look("diffuse", (0.54, 0.5, 0.46))}
    scene.add("terrain", terrain(side, 20.0), "rock")
    scene.images = {"hills_sky.exr": sky(256, (0.3, 0.5, 1.0), (1.0, 0.9, 0.76), (0.2, 0.2, 0.2))}
    scene.lamps = [Lamp("sky", image="hills_sky.exr")]
    return scene


def metals(name: str = "metals", sun: float = 1.0) -> Scene:
    """Metals from near-mirror to rough and two glass balls, lit by a sky whose small sun has most of the light; `sun`: the part
    that comes through haze."""
    scene = Scene(name, (640, 360), 8, Camera((0, 2.3, 7.6), (0, 0.5, 0), 52.0))
    scene.looks = {
        "ground": Look("diffuse", (0.45, 0.43, 0.4)),
        "glass": Look("glass", ior=1.5),
        "chalk": Look("diffuse", (0.7, 0.7, 0.68)),
    }
    scene.add("ground", rectangle((0, 0, 0), (0, 0, 30), (30, 0, 0)), "ground")
    colors: list[Rgb] = [(0.95, 0.93, 0.88), (1.0, 0.77, 0.34), (0.95, 0.64, 0.54), (0.91, 0.92, 0.92), (0.56, 0.57, 0.58)]
    for k, (color, roughness) in enumerate(zip(colors, (0.08, 0.15, 0.25, 0.4, 0.6), strict=True)):
        scene.looks[f"metal_{k}"] = Look("metal", color, roughness)
        scene.add(f"back_{k}", ball(6, 0.62, (1.45 * (k - 2), 0.62, -0.7), smooth=True), f"metal_{k}")
    for k, look in enumerate(("glass", "chalk", "metal_1", "glass")):
        scene.add(f"front_{k}", ball(6, 0.45, (1.3 * (k - 1.5), 0.45, 1.1), smooth=True), look)
    disc = ((0.55, 0.62, 0.35), 0.9, (3200.0 * sun, 2900.0 * sun, 2400.0 * sun))
    scene.images = {f"{name}_sky.exr": sky(1024, (0.2, 0.38, 0.85), (0.8, 0.87, 1.0), (0.22, 0.2, 0.18), disc)}
    scene.lamps = [Lamp("sky", image=f"{name}_sky.exr")]
    return scene


def lamps(count: int = 500) -> Scene:
    """A hall of blocks lit by small coloured balls at every height, most of them hidden from most points; as bright with any
    `count` of them: more are smaller, fewer brighter."""
    scene = Scene("lamps", (640, 360), 4, Camera((0, 3.2, 11.0), (0, 1.1, 0), 52.0))
    scene.looks = {"floor": Look("diffuse", (0.5, 0.5, 0.5)), "block": Look("diffuse", (0.62, 0.58, 0.52))}
    scene.add("floor", rectangle((0, 0, 0), (0, 0, 12), (12, 0, 0)), "floor")
    scene.add("wall", rectangle((0, 4, -8), (12, 0, 0), (0, 4, 0)), "floor")
    rng = np.random.default_rng(31)
    for k in range(48):
        height = rng.uniform(0.2, 0.9)
        at = ((k % 8 - 3.5) * 2.0 + rng.uniform(-0.3, 0.3), height, (k // 8 - 3.5) * 2.0 + rng.uniform(-0.3, 0.3))
        scene.add(f"block_{k}", block(at, (0.35, height, 0.35), rng.uniform(0, 90)), "block")
    for _ in range(count):
        center = (rng.uniform(-9, 9), rng.uniform(0.15, 3.2), rng.uniform(-7.5, 7.0))
        radius = rng.uniform(0.02, 0.06) * min(1.0, np.sqrt(500 / count))
        color = rng.uniform(0.3, 1.0, 3) * 10 ** rng.uniform(0.8, 1.8) * max(1.0, 500 / count)
        scene.lamps.append(Lamp("ball", tuple(float(c) for c in color), center, radius=float(radius)))  # type: ignore[arg-type]
    return scene


def add_room(scene: Scene) -> None:
    """Floor, ceiling and end walls of a room of 6 x 3 x 8, in looks `floor` and `plaster`; its side walls are the scene's."""
    scene.add("ground", rectangle((0, 0, 0), (0, 0, 4), (3, 0, 0)), "floor")
    scene.add("ceiling", rectangle((0, 3, 0), (3, 0, 0), (0, 0, 4)), "plaster")
    scene.add("back", rectangle((0, 1.5, -4), (3, 0, 0), (0, 1.5, 0)), "plaster")
    scene.add("front", rectangle((0, 1.5, 4), (0, 1.5, 0), (3, 0, 0)), "plaster")


def add_closed_room(scene: Scene) -> None:
    """The same with side walls of plaster."""
    add_room(scene)
    for side in (-1, 1):
        scene.add(f"wall_{side + 1}", rectangle((3 * side, 1.5, 0), (0, 1.5, 0), (0, 0, -4.0 * side)), "plaster")


def cove() -> Scene:
    """A room lit by two narrow strips behind ledges below its ceiling: nothing that the camera sees has light at first hand."""
    scene = Scene("cove", (512, 320), 8, Camera((0, 1.4, 3.6), (0, 1.2, -1), 62.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.72, 0.7, 0.66)),
        "floor": Look("diffuse", (0.42, 0.3, 0.2)),
        "blue": Look("diffuse", (0.12, 0.2, 0.5)),
        "clay": Look("diffuse", (0.6, 0.32, 0.2)),
    }
    add_room(scene)
    for side in (-1, 1):
        scene.add(f"wall_{side + 1}", rectangle((3 * side, 1.5, 0), (0, 1.5, 0), (0, 0, -4.0 * side)), "plaster")
        # The strip lies on the shelf; the lip before it hides the part of the ceiling that it lights most from the room.
        scene.add(f"shelf_{side + 1}", block((2.8 * side, 2.6, 0), (0.2, 0.03, 4)), "plaster")
        scene.add(f"lip_{side + 1}", block((2.6 * side, 2.68, 0), (0.02, 0.11, 4)), "plaster")
        scene.lamps.append(Lamp("rect", (500.0, 420.0, 300.0), (2.9 * side, 2.65, 0), (0, 0, 3.5), (0.006, 0, 0)))
    scene.add("table", block((-0.6, 0.4, -1.2), (0.8, 0.4, 0.45), 12), "clay")
    scene.add("chest", block((1.3, 0.55, -2.2), (0.5, 0.55, 0.5), -20), "blue")
    scene.add("globe", ball(4, 0.3, (-0.6, 1.1, -1.2), smooth=True), "plaster")
    return scene


def window() -> Scene:
    """A room lit by a bright sky through one window."""
    scene = Scene("window", (480, 320), 8, Camera((0, 1.4, 3.6), (0.3, 1.2, -1), 62.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.72, 0.7, 0.66)),
        "floor": Look("diffuse", (0.42, 0.3, 0.2)),
        "clay": Look("diffuse", (0.6, 0.32, 0.2)),
    }
    add_room(scene)
    scene.add("right", rectangle((3, 1.5, 0), (0, 1.5, 0), (0, 0, -4.0)), "plaster")
    # The left wall, about a window from 1 to 2.2 above the floor.
    for k, (low, high, far, near) in enumerate([(0, 3, -4, -2.5), (0, 3, -1, 4), (0, 1, -2.5, -1), (2.2, 3, -2.5, -1)]):
        half = (0.1, (high - low) / 2, (near - far) / 2)
        scene.add(f"left_{k}", block((-3.1, (low + high) / 2, (far + near) / 2), half), "plaster")
    scene.add("table", block((-0.6, 0.4, -1.2), (0.8, 0.4, 0.45), 12), "clay")
    scene.add("globe", ball(4, 0.3, (-0.6, 1.1, -1.2), smooth=True), "plaster")
    scene.images = {"window_sky.exr": sky(256, (40, 40, 45), (40, 43, 50), (11, 10, 9))}
    scene.lamps = [Lamp("sky", image="window_sky.exr")]
    return scene


def showroom() -> Scene:
    """Metals from polished to rough in a closed room, under 12 square lamps in its ceiling."""
    scene = Scene("showroom", (480, 320), 6, Camera((0, 1.8, 3.8), (0, 0.8, -0.4), 66.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.7, 0.68, 0.6)),
        "floor": Look("diffuse", (0.4, 0.38, 0.36)),
        "steel": Look("metal", (0.56, 0.57, 0.58), 0.35),
    }
    add_closed_room(scene)
    for k, roughness in enumerate((0.15, 0.25, 0.35, 0.5, 0.7)):
        scene.looks[f"metal_{k}"] = Look("metal", (0.9, 0.75, 0.5), roughness)
        scene.add(f"ball_{k}", ball(5, 0.4, (1.05 * (k - 2), 0.4, 0.2), smooth=True), f"metal_{k}")
    scene.add("counter", block((0, 0.45, -1.6), (2.2, 0.45, 0.4)), "steel")
    for x in (-2.0, -0.7, 0.7, 2.0):
        scene.lamps += [Lamp("rect", (40.0, 38.0, 34.0), (x, 2.95, z), (0.1, 0, 0), (0, 0, 0.1)) for z in (-2.5, -0.5, 1.5)]
    return scene


def signs() -> Scene:
    """A closed room lit by meshes that emit: bent tubes, five bars side by side, a globe, and a panel of two triangles."""
    scene = Scene("signs", (480, 320), 6, Camera((0, 1.4, 3.6), (0, 1.2, -1), 62.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.7, 0.68, 0.64)),
        "floor": Look("diffuse", (0.42, 0.3, 0.2)),
        "clay": Look("diffuse", (0.6, 0.32, 0.2)),
        "black": Look("diffuse", (0.0, 0.0, 0.0)),
        "steel": Look("metal", (0.7, 0.7, 0.72), 0.4),
        "pink": Look("glow", (14.0, 3.0, 8.0)),
        "cyan": Look("glow", (2.0, 9.0, 12.0)),
        "amber": Look("glow", (6.0, 4.0, 1.5)),
        "white": Look("glow", (24.0, 23.0, 21.0)),
    }
    add_closed_room(scene)
    scene.add("table", block((-0.6, 0.4, -1.2), (0.8, 0.4, 0.45), 12), "clay")
    scene.add("chest", block((1.4, 0.55, -2.2), (0.5, 0.55, 0.5), -20), "clay")
    scene.add("ball", ball(5, 0.4, (1.0, 0.4, 0.2), smooth=True), "steel")
    around = np.arange(64) * (2 * np.pi / 64)
    ring = np.stack([0.5 * np.cos(around) - 1.3, 0.5 * np.sin(around) + 1.9, np.full(64, -3.8)], axis=1)
    scene.add("ring", tube(ring, 0.03, 12, closed=True), "pink")
    along = np.linspace(0, 1, 65)
    wave = np.stack([0.2 + 2.2 * along, 1.9 + 0.25 * np.sin(6 * np.pi * along), np.full(65, -3.8)], axis=1)
    scene.add("wave", tube(wave, 0.025, 12, closed=False), "cyan")
    for k in range(5):
        scene.add(f"bar_{k}", block((-2.9, 1.4, -2.6 + 0.2 * k), (0.02, 0.7, 0.03)), "amber")
    scene.add("globe", ball(4, 0.12, (-0.6, 0.92, -1.2)), "white")
    scene.add("panel_back", rectangle((1.6, 2.98, -0.5), (0.3, 0, 0), (0, 0, 0.3)), "black")
    scene.add("panel", rectangle((1.6, 2.97, -0.5), (0.3, 0, 0), (0, 0, 0.3)), "white")
    return scene


def studio() -> Scene:
    """A closed room lit by round lamps close to what they light, two discs and three tubes, and by a heap of glowing rings."""
    scene = Scene("studio", (480, 320), 6, Camera((0, 1.4, 3.6), (0, 1.0, -1), 62.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.7, 0.68, 0.64)),
        "floor": Look("diffuse", (0.42, 0.3, 0.2)),
        "clay": Look("diffuse", (0.6, 0.32, 0.2)),
        "black": Look("diffuse", (0.0, 0.0, 0.0)),
        "steel": Look("metal", (0.7, 0.7, 0.72), 0.3),
        "ember": Look("ember", (9.0, 3.2, 0.8)),
    }
    add_closed_room(scene)
    scene.add("table", block((-0.9, 0.4, -1.0), (0.7, 0.4, 0.45), 8), "clay")
    scene.add("globe", ball(5, 0.16, (-0.7, 0.96, -1.0), smooth=True), "steel")
    scene.add("chest", block((1.2, 0.45, -2.2), (0.6, 0.45, 0.5), -15), "clay")
    scene.add("pot", ball(5, 0.25, (1.2, 1.15, -2.2), smooth=True), "steel")
    # A pendant over the table, and a softbox at the wall.
    scene.add("shade", block((-0.9, 1.47, -1.0), (0.34, 0.015, 0.34)), "black")
    scene.lamps.append(Lamp("disc", (16.0, 13.0, 9.0), (-0.9, 1.45, -1.0), (0.32, 0, 0), (0, 0, 0.32)))
    scene.add("softbox", block((2.93, 1.3, -0.6), (0.015, 0.72, 0.72)), "black")
    scene.lamps.append(Lamp("disc", (1.6, 1.8, 2.2), (2.91, 1.3, -0.6), (0, 0, 0.7), (0, 0.7, 0)))
    for k, (center, half) in enumerate(
        [((-2.3, 1.2, -3.9), (0, 0.8, 0)), ((-1.9, 1.2, -3.9), (0, 0.8, 0)), ((1.2, 1.75, -2.9), (0.7, 0, 0))]
    ):
        scene.lamps.append(Lamp("tube", (6.0, 8.0, 11.0), center, half, radius=0.03))
        scene.add(f"core_{k}", cylinder(center, half, 0.029, 32), "black")  # not every renderer's lamps are in light's way
        for end in (-1, 1):
            at = tuple(c + end * h * 1.02 for c, h in zip(center, half, strict=True))
            scene.add(f"cap_{k}_{end + 1}", block(at, tuple(max(0.02 * h, 0.035) for h in half)), "black")
    rng = np.random.default_rng(41)
    around = np.arange(48) * (2 * np.pi / 48)
    for k in range(9):
        x, y, z = np.array([0.6, 0.32, 0.1]) + rng.uniform(-0.12, 0.12, 3)
        ring = np.stack([0.18 * np.cos(around) + x, 0.18 * np.sin(around) + y, np.full(48, z)], axis=1)
        scene.add(f"ring_{k}", tube(ring, 0.02, 8, closed=True), "ember")
    return scene


def plastics() -> Scene:
    """Plastics from glossy to dull on a polished wooden floor, in a closed room under two large lamps."""
    scene = Scene("plastics", (480, 320), 6, Camera((0, 1.6, 3.7), (0, 0.8, -1), 62.0))
    scene.looks = {
        "plaster": Look("diffuse", (0.7, 0.68, 0.64)),
        "floor": Look("plastic", (0.42, 0.3, 0.2), 0.25),
    }
    add_closed_room(scene)
    colors: list[Rgb] = [
        (0.7, 0.05, 0.04),
        (0.1, 0.5, 0.1),
        (0.05, 0.1, 0.6),
        (0.8, 0.7, 0.1),
        (0.02, 0.02, 0.02),
        (0.8, 0.8, 0.8),
    ]
    for k, (color, roughness) in enumerate(zip(colors, (0.1, 0.2, 0.3, 0.4, 0.15, 0.5), strict=True)):
        scene.looks[f"p{k}"] = Look("plastic", color, roughness)
        x, z = -1.9 + 0.76 * k, -0.4 - 0.9 * (k % 2)
        shape = ball(5, 0.4, (x, 0.4, z), smooth=True) if k % 2 else block((x, 0.45, z), (0.3, 0.45, 0.3), 20 * k)
        scene.add(f"b{k}", shape, f"p{k}")
    scene.lamps += [Lamp("rect", (12.0, 11.5, 10.5), (x, 2.95, -1.0), (0.5, 0, 0), (0, 0, 0.5)) for x in (-1.2, 1.2)]
    return scene


SCENES: dict[str, Callable[[], Scene]] = {
    "box": box,
    "field": field_of_stones,
    "hills": hills,
    "metals": metals,
    "haze": partial(metals, "haze", 0.1),
    "lamps": lamps,
    "cove": cove,
    "window": window,
    "showroom": showroom,
    "plastics": plastics,
    "shelf": shelf,
    "flesh": flesh,
    "groom": groom,
    "pelt": pelt,
    "signs": signs,
    "studio": studio,
    "pool": pool,
    "bulbs": bulbs,
    "junk": junk,
    "ajar": ajar,
    "attic": attic,
    "arcade": arcade,
    "spin": spin,
    "pan": pan,
    "swarm": swarm,
    "flag": flag,
}
