"""Texture file or tile set, with the colour space it is to be converted to."""

from __future__ import annotations

from dataclasses import dataclass

from ..color.color_space import REC709, ColorSpace


@dataclass(frozen=True)
class TextureFile:
    path: str  # resolved by Ar: a file, or "package.usdz[member]"; "" if nothing was found; with <UDIM> or <UVTILE> for a set
    color_space: str | ColorSpace  # "auto", "raw" (numbers), "sRGB", or a name that only the OCIO configuration defines
    tiles: tuple[tuple[int, str], ...] = ()  # of a <UDIM> path: (1001 ... 1100, resolved path)
    target: ColorSpace = REC709  # the rendering space, to which colours are converted
    is_color: bool = True  # else its three channels are numbers: transfer curves are undone, but channels never mixed
    layer: str = ""  # of a multi-part file: a part, or channels with that prefix; "": the default
