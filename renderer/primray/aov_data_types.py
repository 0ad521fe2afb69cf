"""What a UsdRenderVar's dataType asks of the channels that a file has for an AOV."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from .aov_names import UV, XYZ

Stored = Literal["float", "half", "uint"]

# It is "a USD attribute type": how many numbers it has, and whether they are colours.
_TYPE = re.compile(
    r"(float|half|double|int|uint|uchar|int64|uint64|bool)([234]?)|(color|point|vector|normal|texCoord)([234])([fhd])"
)
_LETTERS = {1: ("",), 2: UV, 3: XYZ, 4: ("R", "G", "B", "A")}


@dataclass(frozen=True)
class DataType:
    components: int
    letters: tuple[str, ...]
    stored: Stored


def data_type_of(text: str) -> DataType | None:
    """What a UsdRenderVar's dataType asks of a file; None for types that no channels can hold."""
    match = _TYPE.fullmatch(text)
    if match is None:
        return None
    number, size, role, role_size, precision = match.groups()
    count = int(size or role_size or 1)
    letters = (("R", "G", "B", "A")[:count] if role == "color" else _LETTERS[count]) if count > 1 else ("",)
    if number in ("int", "uint", "uchar", "int64", "uint64", "bool"):
        return DataType(count, letters, "uint")
    return DataType(count, letters, "half" if number == "half" or precision == "h" else "float")
