"""How many units a folder holds: files, where a header and its source are one; what it is and says itself is none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePosixPath

MOST = 16
ROOMS = ("renderer/primray", "renderer/core", "service/primray_service", "tests")
# One file a case or a measurement: nobody reads the folder to find their way.
DATA = {"tests/bench/results", "tests/translation/scenes"}
# Folders that are still too large, with what they hold: a number may only fall, and goes at MOST.
ALLOWED = {
    "service/primray_service/page": 33,
}


def units(paths: Iterable[PurePosixPath]) -> dict[str, int]:
    """By folder."""
    found: dict[str, set[str]] = {}
    for path in paths:
        if path.stem not in ("__init__", "README"):
            is_core = path.suffix in (".hpp", ".cpp", ".h")
            found.setdefault(str(path.parent), set()).add(path.stem if is_core else path.name)
    return {folder: len(names) for folder, names in found.items() if folder not in DATA}


def size_faults(sizes: Mapping[str, int], allowed: Mapping[str, int] = ALLOWED) -> Iterator[str]:
    for folder, size in sorted(sizes.items()):
        if size > allowed.get(folder, MOST):
            yield f"{folder}: {size} units, {allowed.get(folder, MOST)} are allowed; make folders in it"
    for folder, most in allowed.items():
        if most <= MOST or sizes.get(folder, 0) <= MOST:
            yield f"{folder}: needs no allowance any more"
        elif sizes[folder] < most:
            yield f"{folder}: {sizes[folder]} units, {most} are more than it needs"
