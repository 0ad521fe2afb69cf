"""A box of meters around a light: the flux that arrives at white planes on all six sides, as primray renders them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pxr import Usd
from tests.reference.stages import Doubles, Plane, rotation, translation

from primray import RenderSettings, render

PIXELS = 16  # along a side's edge
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def sides(half: float) -> Iterator[Plane]:
    """Facing inwards."""
    for axis in range(3):
        for sign in (-1.0, 1.0):
            middle = np.zeros(3)
            middle[axis] = sign * half
            yield Plane(translation(*middle.tolist()) @ _facing(axis, -sign), half, half)


def _facing(axis: int, sign: float) -> Doubles:
    """With its y along an axis, or against it."""
    turned = (rotation([0, 0, 1], -90), np.eye(4), rotation([1, 0, 0], 90))[axis]
    return turned if sign > 0 else turned @ rotation([1, 0, 0], 180)


def picture(stage: Usd.Stage, spp: int, pixels: int = PIXELS) -> Doubles:
    """(H, W, 3): direct light alone."""
    settings = RenderSettings(spp=spp, resolution=(pixels, pixels), max_depth=1, default_light=False)
    return render(stage, settings).pixels[..., :3].astype(float)


def stage_at(folder: Path, plane: Plane, prims: str, meters_per_unit: float = 1.0, up: str = "Y", layer: str = "") -> Usd.Stage:
    """On disk, beside the files that the prims name; a file of its own each time, since USD remembers them."""
    path = folder / f"stage{len(list(folder.iterdir()))}.usda"
    head = f'#usda 1.0\n(\n    metersPerUnit = {meters_per_unit}\n    upAxis = "{up}"\n{layer})\n'
    path.write_text(head + plane.prims() + prims, encoding="utf-8")
    return Usd.Stage.Open(str(path), Usd.Stage.LoadAll)


def lumens(folder: Path, prims: str, meters_per_unit: float = 1.0, half: float = 3.0, spp: int = 64) -> float:
    """That arrive in all at the sides of a box `2 half` scene units wide; all light must stand within it."""
    total = np.zeros(3)
    for plane in sides(half):
        stage = stage_at(folder, plane, prims, meters_per_unit)
        total += picture(stage, spp).mean(axis=(0, 1)) * np.pi * (2 * half * meters_per_unit) ** 2
    return float(total @ WEIGHTS)
