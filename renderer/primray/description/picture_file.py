"""What a stage's product asks of the EXR that holds the picture: how numbers are stored, and what its header says besides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

COMPRESSIONS = ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")
LOSSY = frozenset({"pxr24", "b44", "b44a", "dwaa", "dwab"})
HeaderValue = str | int | float | tuple[int, ...] | tuple[float, ...]


@dataclass(frozen=True)
class PictureFile:
    """`half` names channels, layers and parts as files.encoding.Encoding does; `header` has attributes by their names."""

    half: tuple[str, ...] = ()
    compression: str = ""  # OpenEXR's name of it; "": zip
    level: float | None = None  # of zip and DWA
    header: tuple[tuple[str, HeaderValue], ...] = ()

    def as_json(self) -> dict[str, Any]:
        return {"half": list(self.half), "compression": self.compression, "level": self.level, "header": dict(self.header)}


PLAIN = PictureFile()


def picture_file_of_json(values: Mapping[str, Any]) -> PictureFile:
    """What `as_json` made; TypeError or ValueError for anything else."""
    level, compression, half = values["level"], values["compression"], tuple(values["half"])
    if compression not in ("", *COMPRESSIONS) or not all(isinstance(name, str) for name in half):
        raise ValueError
    header = {
        str(name): tuple(map(_number, given)) if isinstance(given, list) else _plain(given)
        for name, given in values["header"].items()
    }
    return PictureFile(half, compression, None if level is None else float(_number(level)), tuple(header.items()))


def _number(given: object) -> int | float:
    if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
        raise ValueError
    return given


def _plain(given: object) -> str | int | float:
    return given if isinstance(given, str) else _number(given)
