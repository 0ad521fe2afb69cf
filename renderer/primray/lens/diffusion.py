"""What a lens diffuses, as numbers: how much light leaves its place in the picture, and where it goes. Part of a camera.

The point spread function that they stand for is `diffusing/`'s; docs/lens.md has both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Diffusion:
    """A share of all light that the lens scatters: into a veil over the picture, a bloom about its source, and a star.

    Widths are shares of the whole picture's height, so that pictures of any resolution look alike. Bloom gets what veil and
    star leave. ValueError for what no lens does.

    >>> diffusion = primray.Diffusion(strength=0.1, starburst=0.4)
    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=2)
    >>> camera = dataclasses.replace(image.camera, diffusion=diffusion)
    >>> primray.render("shot.usda", camera=camera, resolution=(32, 18), spp=2).diffused.resolution
    (32, 18)
    """

    strength: float = 0.0  # of all light, 0 to 1; 0: off
    glare: float = 0.2  # of what is diffused, the veil's share
    bloom_width: float = 0.005  # the bloom's narrowest standard deviation
    starburst: float = 0.3  # of what is diffused, the star's share
    starburst_width: float = 0.003  # on the picture, of one wavelength (550 nm) over the aperture's diameter
    blades: int | None = None  # sides of the aperture, 0 a circle; None: as the camera's depth of field has them
    blade_rotation_deg: float = 0.0  # of a corner from +X, towards +Y; with `blades`

    def __post_init__(self) -> None:
        for field in fields(self):
            fault = fault_of(field.name, getattr(self, field.name))
            if fault:
                raise ValueError(fault)
        if self.glare + self.starburst > 1:
            raise ValueError(f"glare {self.glare:g} and starburst {self.starburst:g} are more than all that is diffused")


SHARES, WIDTHS = ("strength", "glare", "starburst"), ("bloom_width", "starburst_width")
WIDEST = 1.0  # of the picture's height


def fault_of(name: str, value: float | None) -> str:
    """What is wrong with one of a Diffusion's numbers; "" for nothing."""
    if name in SHARES and not (value is not None and 0 <= value <= 1):
        return f"{name} is a share of light, from 0 to 1, not {value}"
    if name in WIDTHS and not (value is not None and 0 < value <= WIDEST):
        return f"{name} is a share of the picture's height above 0, at most {WIDEST:g}, not {value}"
    if name == "blades" and value is not None and (value < 0 or value in (1, 2)):
        return f"blades is a number of sides, 0 (a circle) or 3 and more, not {value}"
    if name == "blade_rotation_deg" and not (value is not None and math.isfinite(value)):
        return f"blade_rotation_deg is an angle, not {value}"
    return ""


NO_DIFFUSION = Diffusion()


def diffusion_of(values: Mapping[str, Any]) -> Diffusion:
    """What dataclasses.asdict made; ValueError, KeyError or TypeError where it is none."""
    blades = values["blades"]
    numbers = {field.name: float(values[field.name]) for field in fields(Diffusion) if field.name != "blades"}
    return Diffusion(**numbers, blades=None if blades is None else int(blades))
