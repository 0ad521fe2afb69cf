"""Some bytes under their hash: a file, or a folder as an archive; in parts, which Ray's object store has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

PART_BYTES = 32 * 2**20


@dataclass(frozen=True)
class Content:
    sha256: str  # of all parts together, hexadecimal
    bytes: int
    is_folder: bool
    keep: bool  # it may be asked for again
    parts: tuple[Any, ...]  # refs
