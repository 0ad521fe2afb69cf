"""A file of texels, or a set of tiles, and the space its colours are wanted in. Part of description.py."""

from __future__ import annotations

from dataclasses import dataclass

from ..color.color_space import REC709, ColorSpace


@dataclass(frozen=True)
class TextureFile:
    path: (
        str  # resolved by Ar: a file, or "package.usdz[member]"; "" where nothing was found; with <UDIM> or <UVTILE> for a set
    )
    color_space: str | ColorSpace  # "auto", "raw" (numbers), "sRGB", or a name that only the OCIO configuration knows
    tiles: tuple[tuple[int, str], ...] = ()  # of a <UDIM> path: (1001 ... 1100, resolved path)
    target: ColorSpace = REC709  # where its colours are wanted: the rendering space
    is_color: bool = True  # else three channels are three numbers: curves are undone, and nothing mixes them
    layer: str = ""  # of a file with several: a part, or channels of that prefix; "": the file's own
