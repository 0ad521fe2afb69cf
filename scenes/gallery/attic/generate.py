"""Writes scene.usda and geometry.usdc: an attic whose dust shows the beams of the sun. Made for primray; Apache-2.0.

python -m scenes.gallery.attic.generate

The dust is a medium inside a box, without a surface; a lamp burns in it.
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, UsdGeom, UsdLux, UsdShade
from scenes.gallery.making import Scene, box, joined, lathe, looking, rounded_box, smoothed, turned

rng = np.random.default_rng(5)
WIDE, LONG, KNEE, RIDGE = 2.6, 4.2, 1.0, 3.1  # half of the width and of the length; heights of the knee wall and the ridge

scene = Scene(__file__, "An attic: dust in the beams of the sun.")
scene.camera(eye=(-1.45, 1.3, 3.3), at=(0.35, 1.0, -1.2), focal_length=24)

scene.material("plank", base_color=(0.27, 0.165, 0.09), specular_roughness=0.5)
scene.material("board", base_color=(0.19, 0.115, 0.066), specular_roughness=0.7)
scene.material("beam", base_color=(0.12, 0.07, 0.04), specular_roughness=0.6)
scene.material("leather", base_color=(0.26, 0.095, 0.045), specular_roughness=0.38)
scene.material("brass", base_color=(0.72, 0.48, 0.19), base_metalness=1.0, specular_roughness=0.25)
scene.material("paper", base_color=(0.66, 0.58, 0.44), specular_weight=0.0)
scene.material("cloth", base_color=(0.07, 0.10, 0.17), specular_weight=0.0)


def dust_material() -> None:
    """Per metre: little absorption, and scattering forward."""
    types = Sdf.ValueTypeNames
    made = UsdShade.Material.Define(scene.stage, "/looks/dust")
    particles = UsdShade.Shader.Define(scene.stage, "/looks/dust/particles")
    particles.CreateIdAttr("ND_anisotropic_vdf")
    particles.CreateInput("absorption", types.Float3).Set(Gf.Vec3f(0.002))
    particles.CreateInput("scattering", types.Float3).Set(Gf.Vec3f(0.12))
    particles.CreateInput("anisotropy", types.Float).Set(0.65)
    volume = UsdShade.Shader.Define(scene.stage, "/looks/dust/volume")
    volume.CreateIdAttr("ND_volume")
    volume.CreateInput("vdf", types.Token).ConnectToSource(particles.CreateOutput("out", types.Token))
    made.CreateVolumeOutput("mtlx").ConnectToSource(volume.CreateOutput("out", types.Token))


def floor() -> None:
    planks = []
    for k, x in enumerate(np.arange(-WIDE, WIDE, 0.2)):
        for z in np.arange(-LONG - (k % 3) * 0.7, LONG, 2.1):
            low = float(rng.uniform(-0.004, 0.0))
            planks.append(rounded_box((x, -0.04 + low, z), (x + 0.196, low, z + 2.096), 0.003))
    scene.mesh("/room/floor", *joined(planks), "plank")
    scene.mesh(
        "/room/under_floor", *rounded_box((-WIDE - 0.2, -0.2, -LONG - 0.2), (WIDE + 0.2, -0.05, LONG + 0.8), 0.002), "beam"
    )


def roof_side(side: int, windows: list[tuple[float, float]]) -> None:
    """A slope from the knee wall to the ridge, of panels between the windows; along z from -LONG to LONG."""
    slope = np.array([-side * WIDE, RIDGE - KNEE, 0.0])
    length = float(np.linalg.norm(slope))
    along, normal = slope / length, np.cross(slope / length, (0, 0, 1)) * side
    foot = np.array([side * WIDE, KNEE, 0.0])

    def panel(low: float, high: float, z0: float, z1: float, depth: tuple[float, float] = (0.0, 0.12)) -> tuple:
        points, faces = box((low, depth[0], z0), (high, depth[1], z1))
        placed = foot + points[:, :1] * along + points[:, 1:2] * normal + points[:, 2:] * (0, 0, 1)
        return placed, [list(face) for face in faces] if side < 0 else [list(face)[::-1] for face in faces]

    parts, low, high = [], 0.75, 1.65
    parts += [panel(-0.2, low, -LONG, LONG), panel(high, length + 0.1, -LONG, LONG)]
    edges = [-LONG, *[z for pair in windows for z in pair], LONG]
    parts += [panel(low, high, a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    name = "left" if side < 0 else "right"
    scene.mesh(f"/room/roof_{name}", *joined(parts), "board")
    bars = [panel((low + high) / 2 - 0.02, (low + high) / 2 + 0.02, a, b, (0.02, 0.06)) for a, b in windows]
    bars += [panel(low, high, (a + b) / 2 - 0.02, (a + b) / 2 + 0.02, (0.02, 0.06)) for a, b in windows]
    if bars:
        scene.mesh(f"/room/bars_{name}", *joined(bars), "beam")
    rafters = [panel(-0.1, length, z - 0.06, z + 0.06, (-0.14, -0.002)) for z in np.arange(-LONG + 0.5, LONG, 1.25)]
    scene.mesh(f"/room/rafters_{name}", *joined(rafters), "beam")


def walls() -> None:
    parts = [rounded_box((side * WIDE - 0.1, -0.1, -LONG), (side * WIDE + 0.1, KNEE + 0.1, LONG), 0.002) for side in (-1, 1)]
    for z in (-LONG, LONG + 0.6):
        parts.append(rounded_box((-WIDE - 0.2, -0.1, z - 0.15), (WIDE + 0.2, RIDGE + 0.3, z), 0.002))
    scene.mesh("/room/walls", *joined(parts), "board")
    ties = [rounded_box((-1.25, 2.02, z - 0.07), (1.25, 2.2, z + 0.07), 0.012) for z in (-2.45, 0.05)]
    posts = [rounded_box((0.93, 0, z - 0.07), (1.07, 2.05, z + 0.07), 0.012) for z in (-2.45,)]
    scene.mesh("/room/ties", *joined(ties + posts), "beam")


def trunk(name: str, at: tuple[float, float, float], turn: float) -> None:
    body = rounded_box((-0.45, 0.0, -0.27), (0.45, 0.38, 0.27), 0.015)
    lid = rounded_box((-0.46, 0.385, -0.28), (0.46, 0.52, 0.28), 0.05)
    bands = [rounded_box((x - 0.03, -0.002, -0.285), (x + 0.03, 0.526, 0.285), 0.01) for x in (-0.3, 0.3)]
    for part, parts, material in (("body", [body, lid], "leather"), ("bands", bands, "brass")):
        points, faces = joined(parts)
        scene.mesh(f"/things/{name}/{part}", turned(points, turn, at), faces, material)


def books(at: tuple[float, float, float]) -> None:
    height = 0.0
    for k, material in enumerate(("leather", "cloth", "paper", "cloth", "leather")):
        thick, wide = float(rng.uniform(0.03, 0.055)), float(rng.uniform(0.13, 0.16))
        points, faces = rounded_box((-wide, height, -0.1), (wide, height + thick, 0.1), 0.004)
        scene.mesh(f"/things/book_{k}", turned(points, float(rng.uniform(-25, 25)), at), faces, material)
        height += thick + 0.001


def lantern(at: tuple[float, float, float]) -> None:
    base = smoothed([(0.0, 0.0), (0.075, 0.0), (0.08, 0.02), (0.05, 0.05), (0.045, 0.07), (0.0, 0.07)], 4)
    cap = smoothed([(0.0, 0.3), (0.012, 0.29), (0.05, 0.26), (0.06, 0.24), (0.0, 0.24)], 4)
    for name, profile in (("base", base), ("cap", cap)):
        points, faces = lathe(profile, 40)
        scene.mesh(f"/things/lantern_{name}", points + at, faces, "brass")
    rods = [rounded_box((x - 0.004, 0.06, z - 0.004), (x + 0.004, 0.25, z + 0.004), 0.001)
            for x, z in ((0.05, 0), (-0.05, 0), (0, 0.05), (0, -0.05))]  # fmt: skip
    points, faces = joined(rods)
    scene.mesh("/things/lantern_rods", points + at, faces, "brass")
    scene.ball_light("/lights/flame", (at[0], at[1] + 0.14, at[2]), 0.02, 120.0, (1.0, 0.55, 0.2))


floor()
roof_side(-1, [])
roof_side(1, [(-3.35, -2.65), (-1.85, -1.15), (-0.35, 0.35)])
walls()
trunk("trunk", (0.02, 0.0, -1.15), 24)
trunk("chest", (-1.6, 0.0, -1.5), -12)
books((-0.08, 0.521, -1.12))
lantern((-1.5, 0.521, -1.42))
scene.mesh("/things/box", *rounded_box((1.2, 0.0, -3.6), (2.0, 0.7, -2.7), 0.01), "plank")

dust_material()
air = UsdGeom.Cube.Define(scene.stage, "/air")
air.CreateSizeAttr(1.0)
air.AddTransformOp().Set(Gf.Matrix4d().SetScale(Gf.Vec3d(5.6, 3.6, 9.4)) * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 1.6, 0.25)))
scene.bind(air.GetPrim(), "dust")

sun = UsdLux.DistantLight.Define(scene.stage, "/lights/sun")
sun.CreateAngleAttr(0.53)
sun.CreateIntensityAttr(900000.0)
sun.CreateColorAttr(Gf.Vec3f(1.0, 0.86, 0.66))
sun.AddTransformOp().Set(looking((2.4, 2.6, -1.3), (0.0, 0.0, 0.0)))
sky = UsdLux.DomeLight.Define(scene.stage, "/lights/sky")
sky.CreateColorAttr(Gf.Vec3f(0.55, 0.72, 1.0))
sky.CreateIntensityAttr(2.0)

scene.save()
