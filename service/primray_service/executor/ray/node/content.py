"""Content under its hash: a file, or a folder as an archive; in blocks, which are in Ray's object store."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

PART_BYTES = 32 * 2**20


@dataclass(frozen=True)
class Content:
    sha256: str  # of all blocks together, hexadecimal
    bytes: int
    is_folder: bool
    keep: bool  # whether it may be needed again
    parts: tuple[Any, ...]  # refs
