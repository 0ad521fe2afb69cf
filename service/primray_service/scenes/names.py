"""Names of scenes: for people, and for the file that messages name."""

from __future__ import annotations

import re
from pathlib import PurePosixPath

MOST_CHARS = 120  # of a file's name
MOST_NAME_CHARS = 255  # of a job's
# No separators, nothing with a meaning in USD paths (@, brackets, colons, quotes), no hidden files.
_PLAIN = re.compile(r"[^\W_][^/\\\x00-\x1f\x7f@<>\[\]\"'`:${}]*")
_SUFFIXES = {"usda": (".usda", ".usd"), "usdc": (".usdc", ".usd"), "usdz": (".usdz",)}


def job_name(scene: str, entry: str | None, camera: str | None, frames: str | None) -> str:
    """Return the name for a job that was given none: its scene's or layer's, with what distinguishes it from others of the same
    scene."""
    stem = PurePosixPath(entry or scene or "scene").stem
    camera = PurePosixPath(camera).name if camera else None
    return " ".join(filter(None, (stem, camera, frames)))[:MOST_NAME_CHARS]


def file_name(name: str, kind: str) -> str:
    """Return a plain file name for a scene that was sent as `name`, with a suffix of its kind; scene.KIND if the name is not
    plain."""
    path = PurePosixPath(name.replace("\\", "/"))
    stem = path.stem if path.suffix.lower() in (".usda", ".usdc", ".usdz", ".usd", ".zip") else path.name
    if len(stem.encode()) > MOST_CHARS or not _PLAIN.fullmatch(stem):
        return f"scene.{kind}"
    return f"{stem}{path.suffix if path.suffix in _SUFFIXES[kind] else f'.{kind}'}"
