"""Diffusion of a lens (veiling glare, bloom, starburst), as parameters of a camera.

`diffusing/` makes the point spread function from them; docs/lens.md describes both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Diffusion:
    """Light that the lens scatters: into a veil over the whole picture, a bloom around its source, and a starburst.

    Widths are fractions of the whole picture's height, so that the look does not depend on the resolution. The bloom gets the
    share that veil and starburst leave. ValueError for values out of range.

    >>> diffusion = primray.Diffusion(strength=0.1, starburst=0.4)
    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=2)
    >>> camera = dataclasses.replace(image.camera, diffusion=diffusion)
    >>> primray.render("shot.usda", camera=camera, resolution=(32, 18), spp=2).diffused.resolution
    (32, 18)
    """

    strength: float = 0.0  # share of all light that is diffused, 0 to 1; 0: off
    glare: float = 0.2  # the veil's share of the diffused light
    bloom_width: float = 0.005  # narrowest standard deviation of the bloom
    starburst: float = 0.3  # the starburst's share of the diffused light
    starburst_width: float = 0.003  # width in the picture of one wavelength (550 nm) over the aperture's diameter
    blades: int | None = None  # sides of the aperture, 0 a circle; None: those of the camera's depth of field
    blade_rotation_deg: float = 0.0  # of a corner from +X, towards +Y; with `blades`

    def __post_init__(self) -> None:
        for field in fields(self):
            fault = fault_of(field.name, getattr(self, field.name))
            if fault:
                raise ValueError(fault)
        if self.glare + self.starburst > 1:
            raise ValueError(f"glare {self.glare:g} and starburst {self.starburst:g} together must be at most 1")


SHARES, WIDTHS = ("strength", "glare", "starburst"), ("bloom_width", "starburst_width")
WIDEST_DIFFUSION = 1.0  # largest width, as a fraction of the picture's height


def fault_of(name: str, value: float | None) -> str:
    """Return why a value of a Diffusion's field is invalid; "" if it is valid."""
    if name in SHARES and not (value is not None and 0 <= value <= 1):
        return f"{name} is a share of light, from 0 to 1, not {value}"
    if name in WIDTHS and not (value is not None and 0 < value <= WIDEST_DIFFUSION):
        return f"{name} is a share of the picture's height above 0, at most {WIDEST_DIFFUSION:g}, not {value}"
    if name == "blades" and value is not None and (value < 0 or value in (1, 2)):
        return f"blades is a number of sides, 0 (a circle) or 3 and more, not {value}"
    if name == "blade_rotation_deg" and not (value is not None and math.isfinite(value)):
        return f"blade_rotation_deg is an angle, not {value}"
    return ""


NO_DIFFUSION = Diffusion()


def diffusion_of(values: Mapping[str, Any]) -> Diffusion:
    """Return the Diffusion that dataclasses.asdict serialized; ValueError, KeyError or TypeError for anything else."""
    blades = values["blades"]
    numbers = {field.name: float(values[field.name]) for field in fields(Diffusion) if field.name != "blades"}
    return Diffusion(**numbers, blades=None if blades is None else int(blades))
