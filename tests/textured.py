"""Textured plates in front of a camera that looks at one texel a pixel, for tests of what surfaces' inputs read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.described import Described, describe, lambert, look_at, orthographic, quad, render

from primray.description import Input, Interpolation, Mesh, Primvar, PrimvarInput, Surface, TextureFile, TextureInput, Wrap

ST = PrimvarInput("st", (0.0, 0.0))
UNIT_ST = ((0, 0), (1, 0), (1, 1), (0, 1))
FILE = TextureFile("texture", "raw")
CENTRES_ONLY = 1e-3  # a box filter so narrow that samples stay at pixel centres
Numbers = Sequence[Sequence[float]] | npt.NDArray[Any]


def texture(channels: str = "rgb", file: TextureFile = FILE, wrap: Wrap = Wrap.CLAMP, **more: Any) -> TextureInput:
    return TextureInput(file, channels, more.pop("st", ST), wrap_s=wrap, wrap_t=wrap, **more)


def with_primvars(mesh: Mesh, *primvars: Primvar) -> Mesh:
    return replace(mesh, primvars=(*mesh.primvars, *primvars))


def primvar(name: str, values: npt.ArrayLike, interpolation: Interpolation = Interpolation.POINT) -> Primvar:
    v = np.asarray(values, np.float32)
    return Primvar(name, interpolation, v if v.ndim == 2 else v[:, None])


def plate(st: Numbers = UNIT_ST, half: float = 1.0, surface: int = 0) -> Mesh:
    """In the plane z = 0, facing +z, counter-clockwise from the lower left corner."""
    h = half
    return with_primvars(quad([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]], surface), primvar("st", st))


def glowing(value: Input) -> Surface:
    """Black but for its emission."""
    return replace(lambert(0.0), inputs=(("emissive_color", value),))


def look_at_plate(
    surface: Surface, textures: Any, resolution: tuple[int, int], mesh: Mesh | None = None, **more: Any
) -> Described:
    """The plate fills the picture."""
    camera = replace(orthographic(look_at([0, 0, 5], [0, 0, 0]), 1.0), window=(-1, 1, -1, 1))
    return describe([(mesh or plate(), np.eye(4))], [surface], camera=camera, resolution=resolution, textures=textures, **more)


def pixels_of(described: Described, spp: int = 2, **more: Any) -> npt.NDArray[np.float32]:
    """(H, W, 3), each pixel at its centre."""
    image: npt.NDArray[np.float32] = render(described.build(filter_width=CENTRES_ONLY), spp, **more).pixels(1.0)
    return image[..., :3]
