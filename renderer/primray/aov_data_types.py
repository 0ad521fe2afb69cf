"""Data types of UsdRenderVars: number, names and storage of an AOV's channels in a file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from .aov_names import UV, XYZ

Stored = Literal["float", "half", "uint"]

# "A USD attribute type", of which the number of components, the role and the precision count.
_TYPE = re.compile(
    r"(float|half|double|int|uint|uchar|int64|uint64|bool)([234]?)|(color|point|vector|normal|texCoord)([234])([fhd])"
)
_LETTERS = {1: ("",), 2: UV, 3: XYZ, 4: ("R", "G", "B", "A")}


@dataclass(frozen=True)
class DataType:
    """Channels of an AOV in a file."""

    components: int
    letters: tuple[str, ...]
    stored: Stored


def data_type_of(text: str) -> DataType | None:
    """Return the channels for a UsdRenderVar's dataType; None for types that channels cannot hold."""
    match = _TYPE.fullmatch(text)
    if match is None:
        return None
    number, size, role, role_size, precision = match.groups()
    count = int(size or role_size or 1)
    letters = (("R", "G", "B", "A")[:count] if role == "color" else _LETTERS[count]) if count > 1 else ("",)
    if number in ("int", "uint", "uchar", "int64", "uint64", "bool"):
        return DataType(count, letters, "uint")
    return DataType(count, letters, "half" if number == "half" or precision == "h" else "float")
