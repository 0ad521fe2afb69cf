"""Placeholders in image file names: tiles of a set (<UDIM>, <UVTILE>) and the frame ({frame}, {04frame}).

MaterialX, "Filename Substitutions"; <UDIM> is UsdUVTexture's, too.
"""

from __future__ import annotations

import glob
import math
import os
import re
from dataclasses import dataclass

from pxr import Ar, Sdf, UsdShade

UVTILE = "<UVTILE>"
_FIRST, _ACROSS, _TILES = 1001, 10, 100
_FRAME = re.compile(r"\{(?:0(\d+))?frame\}")

_TOKEN = re.compile(r"(<UDIM>|<UVTILE>|\{(?:0\d+)?frame\})")
_NUMBERS = {"<UDIM>": r"1(?:0\d[1-9]|0[1-9]0|100)", UVTILE: r"_?u(?:[1-9]|10)_v(?:[1-9]|10)"}


@dataclass(frozen=True)
class Frames:
    """Frame settings of an image node: "framerange", "frameoffset", "frameendaction"."""

    first: int | None = None
    last: int | None = None
    offset: int = 0
    end_action: str = "constant"

    def number(self, frame: float) -> int | None:
        """Return a file's frame number at a frame; None where the node's default is shown instead."""
        wanted = math.floor(frame) + self.offset
        if self.first is None or self.last is None or self.first <= wanted <= self.last:
            return wanted
        count = self.last - self.first + 1
        match self.end_action:
            case "clamp":
                return min(max(wanted, self.first), self.last)
            case "periodic":
                return self.first + (wanted - self.first) % count
            case "mirror":
                at = (wanted - self.first) % (2 * count)
                return self.first + min(at, 2 * count - 1 - at)
        return None


def frames_of(text: str) -> tuple[int, int] | None:
    """Return the first and the last frame of a range such as "10-99"; None where the text is not a range."""
    found = re.fullmatch(r"\s*(-?\d+)\s*-\s*(-?\d+)\s*", text)
    return (int(found[1]), int(found[2])) if found and int(found[1]) <= int(found[2]) else None


def has_frame_token(path: str) -> bool:
    return "frame}" in path and _FRAME.search(path) is not None


def with_frame(path: str, number: int) -> str:
    return _FRAME.sub(lambda found: f"{number:0{int(found[1] or 0)}d}", path)


def is_tiles(path: str) -> bool:
    return UVTILE in path or bool(UsdShade.UdimUtils.IsUdimIdentifier(path))


def has_tokens(path: str) -> bool:
    """Return whether a name has placeholders, for tiles or frames."""
    return is_tiles(path) or has_frame_token(path)


def files_at(path: str) -> list[str]:
    """Return all existing files that a name with placeholders may refer to, at any frame."""
    parts = _TOKEN.split(path)
    pattern = re.compile("".join(_NUMBERS.get(p, r"-?\d+") if _TOKEN.fullmatch(p) else re.escape(p) for p in parts))
    found = glob.glob("".join("*" if _TOKEN.fullmatch(part) else glob.escape(part) for part in parts))
    return sorted(os.path.abspath(file) for file in found if pattern.fullmatch(file))


def resolved(path: str, layer: Sdf.Layer | None) -> str:
    """Return the resolved path of a path authored in a layer, "" where it does not exist."""
    anchored = Sdf.ComputeAssetPathRelativeToLayer(layer, path) if layer is not None else path
    return str(Ar.GetResolver().Resolve(anchored)) if anchored else ""


def tile_paths(path: str, layer: Sdf.Layer | None) -> tuple[str, tuple[tuple[int, str], ...]]:
    """Return the resolved name of a set, and its tiles' numbers (1001 to 1100, ten in u by ten in v) and resolved paths."""
    if UVTILE in path:
        return _numbered(path, _uv_tiles(path, layer))
    found = UsdShade.UdimUtils.ResolveUdimTilePaths(path, layer)
    tiles = [(int(number), str(name)) for name, number in found]
    return _numbered(path, [(number, name, str(number), "<UDIM>") for number, name in tiles])


def _uv_tiles(path: str, layer: Sdf.Layer | None) -> list[tuple[int, str, str, str]]:
    """Return tiles by Mudbox's names, which count from 1 ("u1_v1"), optionally after an underscore ("_u1_v1")."""
    found = []
    for number in range(_FIRST, _FIRST + _TILES):
        v, u = divmod(number - _FIRST, _ACROSS)
        for text in (f"u{u + 1}_v{v + 1}", f"_u{u + 1}_v{v + 1}"):
            if name := resolved(path.replace(UVTILE, text), layer):
                found.append((number, name, text, UVTILE))
                break
    return found


def _numbered(path: str, found: list[tuple[int, str, str, str]]) -> tuple[str, tuple[tuple[int, str], ...]]:
    if not found:
        return path, ()
    _, first, text, place = found[0]
    before, _, after = first.rpartition(text)
    return f"{before}{place}{after}", tuple(sorted((number, name) for number, name, _, _ in found))
