"""Writes scene.usda and geometry.usdc: a bronze that is a subdivided cage, and the cage. Made for primray; Apache-2.0.

python -m scenes.gallery.sculpture.generate
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pxr import Vt
from scenes.gallery.making import Scene, box, joined, rounded_box, turned

scene = Scene(__file__, "A bronze, which is a subdivided cage of some hundred faces, and the cage itself in plaster.")
scene.camera(eye=(0.5, 1.62, 4.15), at=(0.2, 1.36, 0), focal_length=50, f_stop=4, focus=(-0.25, 1.6, 0.25))

scene.material(
    "bronze", base_color=(0.52, 0.29, 0.13), base_metalness=1.0, specular_color=(1.0, 0.86, 0.7), specular_roughness=0.27
)
scene.material("eye", base_color=(0.9, 0.62, 0.22), base_metalness=1.0, specular_roughness=0.12)
scene.material("plaster", base_color=(0.74, 0.72, 0.68), specular_weight=0.0)
scene.material("plinth", base_color=(0.055, 0.052, 0.05), specular_roughness=0.28)
scene.material("floor", base_color=(0.20, 0.185, 0.17), specular_roughness=0.3)
scene.material("wall", base_color=(0.30, 0.055, 0.045), specular_weight=0.0)
scene.material("rail", base_color=(0.62, 0.6, 0.56), specular_roughness=0.5)
scene.material("brass", base_color=(0.88, 0.66, 0.32), base_metalness=1.0, specular_roughness=0.3)


class Cage:
    """Quads that are extruded, one by one: how a character is begun in a modeller."""

    def __init__(self, low: Sequence[float], high: Sequence[float]) -> None:
        points, faces = box(tuple(low), tuple(high))
        self.points, self.faces = [*points], [list(map(int, face)) for face in faces]
        self.sharp: list[tuple[int, int]] = []  # edges that stay

    def facing(self, way: Sequence[float], near: Sequence[float] | None = None) -> int:
        """The face that looks most this way; of those that do nearly as much, the nearest to a point."""
        towards = np.asarray(way, float) / np.linalg.norm(way)
        looks = np.array([self.normal(k) @ towards for k in range(len(self.faces))])
        if near is None:
            return int(np.argmax(looks))
        distance = [np.linalg.norm(self.centre(k) - near) + (9 if looks[k] < 0.6 else 0) for k in range(len(self.faces))]
        return int(np.argmin(distance))

    def centre(self, face: int) -> np.ndarray:
        return np.mean([self.points[k] for k in self.faces[face]], 0)

    def normal(self, face: int) -> np.ndarray:
        a, b, c, d = (self.points[k] for k in self.faces[face])
        n = np.cross(c - a, d - b)
        return n / max(np.linalg.norm(n), 1e-12)

    def extrude(
        self, face: int, move: Sequence[float], scale: float | Sequence[float] = 1.0, turn: Callable | None = None
    ) -> int:
        """Moves a copy of the face, scaled about its centre, and joins it by quads; the copy keeps the number."""
        old, centre = self.faces[face], self.centre(face)
        new = []
        for k in old:
            offset = (self.points[k] - centre) * np.asarray(scale)
            self.points.append(centre + np.asarray(move) + (turn(offset) if turn else offset))
            new.append(len(self.points) - 1)
        for i in range(4):
            j = (i + 1) % 4
            self.faces.append([old[i], old[j], new[j], new[i]])
        self.faces[face] = new
        return face

    def crease(self, face: int) -> None:
        these = self.faces[face]
        self.sharp += [(these[i], these[(i + 1) % 4]) for i in range(4)]


def tipped(about_x: float, about_z: float = 0.0) -> Callable:
    cx, sx = np.cos(np.radians(about_x)), np.sin(np.radians(about_x))
    cz, sz = np.cos(np.radians(about_z)), np.sin(np.radians(about_z))
    turn = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return lambda offset: turn @ offset


def creature() -> Cage:
    """A sitting guardian: haunches, forelegs, chest, neck, head with muzzle and ears, a tail around its feet."""
    c = Cage((-0.26, 0.10, -0.34), (0.26, 0.44, 0.10))
    top = c.facing((0, 1, 0))
    c.extrude(top, (0, 0.18, 0.05), (0.92, 1, 0.86))
    c.extrude(top, (0, 0.20, 0.10), (0.92, 1, 0.84))  # chest
    c.extrude(top, (0, 0.12, 0.05), (0.70, 1, 0.80))
    c.extrude(top, (0, 0.13, 0.045), (0.80, 1, 0.95))  # neck
    c.extrude(top, (0, 0.09, 0.05), (1.62, 1, 1.5))  # jaw
    c.extrude(top, (0, 0.17, 0.015), (1.06, 1, 1.04))  # brow
    head = c.centre(top)
    c.extrude(top, (0, 0.07, -0.02), (0.72, 1, 0.7))
    for side in (-1, 1):
        # An ear out of the head's upper side.
        ear = c.facing((side, 0.55, 0), head + (0.11 * side, 0.05, -0.02))
        c.extrude(ear, (0.025 * side, 0.06, -0.01), 0.72)
        c.extrude(ear, (0.045 * side, 0.13, -0.02), 0.62)
        c.extrude(ear, (0.03 * side, 0.10, -0.035), 0.25)
    face = c.facing((0, 0, 1), head + (0, -0.08, 0.16))
    c.extrude(face, (0, -0.025, 0.075), (0.56, 0.6, 1))
    c.extrude(face, (0, -0.02, 0.09), (0.82, 0.78, 1))
    c.extrude(face, (0, -0.01, 0.03), (0.55, 0.5, 1))
    for side in (-1, 1):
        haunch = c.facing((side, 0, 0), (0.26 * side, 0.27, -0.12))
        c.extrude(haunch, (0.09 * side, -0.02, 0.0), (1, 0.9, 0.9))
        c.extrude(haunch, (0.06 * side, -0.03, 0.02), (1, 0.66, 0.66))
        shoulder = c.facing((side, 0, 0), (0.25 * side, 0.75, 0.08))
        c.extrude(shoulder, (0.05 * side, -0.05, 0.07), (1, 0.95, 0.85))
        c.extrude(shoulder, (0.02 * side, -0.16, 0.10), (1, 0.9, 0.95), tipped(0, -side * 55))
        c.extrude(shoulder, (-0.035 * side, -0.26, 0.045), (0.85, 0.85, 0.85), tipped(0, -side * 28))
        c.extrude(shoulder, (-0.01 * side, -0.22, 0.01), 0.92)
        c.extrude(shoulder, (0.0, -0.05, 0.035), (1.25, 1, 1.45))
        c.extrude(shoulder, (0.0, -0.04, 0.01), (0.95, 1, 0.95))
    belly = c.facing((0, 0, 1), (0, 0.27, 0.10))
    c.extrude(belly, (0, -0.03, 0.05), (0.9, 0.8, 1))
    for side in (-1, 1):
        paw = c.facing((0, -1, 0), (0.36 * side, 0.12, -0.1))
        c.extrude(paw, (0.02 * side, -0.05, 0.06), (1, 1, 0.9))
    tail = c.facing((0, 0, -1), (0, 0.27, -0.34))
    c.extrude(tail, (0.02, -0.07, -0.10), (0.36, 0.5, 1))
    for move, scale in (
        ((0.12, -0.06, -0.06), 0.95),
        ((0.20, -0.02, 0.03), 0.95),
        ((0.16, 0.0, 0.16), 0.95),
        ((0.06, 0.0, 0.20), 0.95),
        ((-0.03, 0.0, 0.18), 0.9),
        ((-0.10, 0.01, 0.12), 0.7),
        ((-0.08, 0.015, 0.05), 0.4),
    ):
        c.extrude(tail, move, scale, tipped(0, 0))
    base = c.facing((0, -1, 0), (0, 0.1, -0.12))
    c.extrude(base, (0, -0.06, 0.0), (0.96, 1, 0.96))
    return c


def put(path: str, c: Cage, scale: float, to: tuple[float, float, float], turn: float, material: str, subdivision: str) -> None:
    points = turned(np.array(c.points) * scale, turn)
    points += np.asarray(to) - (0, points[:, 1].min(), 0)
    made = scene.mesh(path, points, c.faces, material, subdivision=subdivision)
    if c.sharp and subdivision != "none":
        with scene.bulk():
            made.CreateCreaseIndicesAttr(Vt.IntArray([k for edge in c.sharp for k in edge]))
            made.CreateCreaseLengthsAttr(Vt.IntArray([2] * len(c.sharp)))
            made.CreateCreaseSharpnessesAttr(Vt.FloatArray([2.5] * len(c.sharp)))


def hall() -> None:
    scene.mesh("/hall/floor", np.array([(-9, 0, 8), (9, 0, 8), (9, 0, -2.4), (-9, 0, -2.4)]), [[0, 1, 2, 3]], "floor")
    scene.mesh("/hall/wall", np.array([(-9, 0, -2.4), (9, 0, -2.4), (9, 6, -2.4), (-9, 6, -2.4)]), [[0, 1, 2, 3]], "wall")
    boards = [((-9, 0, -2.4), (9, 0.22, -2.36)), ((-9, 0.92, -2.4), (9, 0.99, -2.35))]
    scene.mesh("/hall/boards", *joined([rounded_box(a, b, 0.012) for a, b in boards]), "rail")
    frames = []
    for x in (-4.05, -2.35, 1.55, 3.25):
        w, low, high, d = 0.62, 1.25, 2.75, 0.035
        frames += [((x - w, low, -2.4), (x - w + d, high, -2.37)), ((x + w - d, low, -2.4), (x + w, high, -2.37))]
        frames += [((x - w, low, -2.4), (x + w, low + d, -2.37)), ((x - w, high - d, -2.4), (x + w, high, -2.37))]
    scene.mesh("/hall/panels", *joined([rounded_box(a, b, 0.008) for a, b in frames]), "wall")
    for name, x, z, wide, tall in (("large", -0.25, 0.0, 0.46, 0.86), ("small", 0.78, 0.28, 0.24, 1.02)):
        parts = [rounded_box((x - wide, 0, z - wide), (x + wide, tall, z + wide), 0.012)]
        parts += [rounded_box((x - wide - 0.03, 0, z - wide - 0.03), (x + wide + 0.03, 0.09, z + wide + 0.03), 0.01)]
        parts += [rounded_box((x - wide - 0.02, tall - 0.05, z - wide - 0.02), (x + wide + 0.02, tall, z + wide + 0.02), 0.01)]
        scene.mesh(f"/hall/plinth_{name}", *joined(parts), "plinth")
    label = rounded_box((-0.37, 0.62, 0.46), (-0.13, 0.72, 0.466), 0.002)
    scene.mesh("/hall/label", *label, "brass")


guardian = creature()
hall()
put("/sculpture", guardian, 0.74, (-0.25, 0.86, 0.0), 24, "bronze", "catmullClark")
put("/cage", guardian, 0.40, (0.78, 1.02, 0.28), -18, "plaster", "none")
scene.rect_light("/lights/key", (-2.1, 3.4, 2.2), (-0.25, 1.4, 0), (1.1, 1.1), 60, (1.0, 0.87, 0.7))
scene.rect_light("/lights/rim", (3.1, 3.0, -1.5), (-0.2, 1.5, 0), (0.6, 1.4), 110, (0.72, 0.84, 1.0))
scene.rect_light("/lights/fill", (3.4, 2.0, 3.2), (0.2, 1.2, 0), (1.6, 2.2), 5, (0.8, 0.88, 1.0))
scene.rect_light("/lights/wash", (-0.9, 4.4, -1.6), (-0.7, 1.6, -2.4), (1.6, 0.2), 26, (1.0, 0.85, 0.66))
scene.save()
