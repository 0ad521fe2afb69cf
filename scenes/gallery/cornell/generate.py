"""Writes scene.usda: Cornell's box with a tall block and a glass ball. Made for primray; Apache-2.0.

python -m scenes.gallery.cornell.generate
"""

from __future__ import annotations

import numpy as np
from scenes.gallery.making import Scene, box, turned

scene = Scene(__file__, "Cornell's box, 2 m wide: a tall block, a ball of glass, one lamp.")
scene.camera(eye=(0, 1, 5.15), at=(0, 1, 0), focal_length=44)
scene.material("white", base_color=(0.73, 0.72, 0.69), specular_weight=0.0)
scene.material("red", base_color=(0.6, 0.05, 0.04), specular_weight=0.0)
scene.material("green", base_color=(0.1, 0.42, 0.09), specular_weight=0.0)
scene.material("glass", transmission_weight=1.0, specular_roughness=0.0, specular_ior=1.5)

WIDE = 1.78  # half of the box: as wide as the picture
for name, material, corners in (
    ("floor", "white", [(-WIDE, 0, 1), (WIDE, 0, 1), (WIDE, 0, -1), (-WIDE, 0, -1)]),
    ("ceiling", "white", [(-WIDE, 2, -1), (WIDE, 2, -1), (WIDE, 2, 1), (-WIDE, 2, 1)]),
    ("back", "white", [(-WIDE, 0, -1), (WIDE, 0, -1), (WIDE, 2, -1), (-WIDE, 2, -1)]),
    ("left", "red", [(-WIDE, 0, 1), (-WIDE, 0, -1), (-WIDE, 2, -1), (-WIDE, 2, 1)]),
    ("right", "green", [(WIDE, 0, -1), (WIDE, 0, 1), (WIDE, 2, 1), (WIDE, 2, -1)]),
):
    scene.mesh(f"/box/{name}", np.array(corners), [[0, 1, 2, 3]], material)


points, faces = box((-0.32, 0, -0.32), (0.32, 1.25, 0.32))
scene.mesh("/box/tall", turned(points, 18, (-0.62, 0, -0.35)), faces, "white")
points, faces = box((-0.36, 0, -0.36), (0.36, 0.12, 0.36))
scene.mesh("/box/low", turned(points, -20, (0.55, 0, 0.25)), faces, "white")
ball = scene.sphere("/box/ball", (0.55, 0.12 + 0.36, 0.25), 0.36, "glass")
scene.rect_light("/box/lamp", (0, 1.995, 0), (0, 0, 0), (0.8, 0.5), 34, (1, 0.86, 0.68))
scene.save()
