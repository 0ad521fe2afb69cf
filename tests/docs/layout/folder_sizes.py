"""How many units a folder holds: files, where a header and its source are one; what it is and says itself is none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePosixPath

MOST = 20
ROOMS = ("renderer/primray", "renderer/core", "service/primray_service", "tests")
# One file a case or a measurement: nobody reads the folder to find their way.
DATA = {"tests/bench/results", "tests/translation/scenes"}


def units(paths: Iterable[PurePosixPath]) -> dict[str, int]:
    """By folder."""
    found: dict[str, set[str]] = {}
    for path in paths:
        if path.stem not in ("__init__", "README"):
            is_core = path.suffix in (".hpp", ".cpp", ".h")
            found.setdefault(str(path.parent), set()).add(path.stem if is_core else path.name)
    return {folder: len(names) for folder, names in found.items() if folder not in DATA}


def size_faults(sizes: Mapping[str, int]) -> Iterator[str]:
    for folder, size in sorted(sizes.items()):
        if size > MOST:
            yield f"{folder}: {size} units, {MOST} are allowed; make folders in it"
