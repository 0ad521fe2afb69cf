"""The files that a frame leaves, by the endings of their names: .exr is the record, .png a view of it, .json the report."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .channel import finite

if TYPE_CHECKING:
    from primray.image import Image

MEDIA_TYPES = {".exr": "image/x-exr", ".png": "image/png", ".json": "application/json"}
DEFAULT_NAMES = ("beauty.exr", "beauty.png", "report.json")


def write_outputs(image: Image, names: Sequence[str], folder: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """What `done` says of each file, and the report with what writing took."""
    start = time.perf_counter()
    for name in names:
        if not name.endswith(".json"):
            image.save(folder / name)
    stages_s = {**image.report["stages_s"], "write": time.perf_counter() - start}
    report = finite({**image.report, "outputs": list(names), "stages_s": stages_s})
    for name in names:
        if name.endswith(".json"):
            (folder / name).write_text(json.dumps(report, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return [_described(folder / name) for name in names], report


def _described(path: Path) -> dict[str, Any]:
    with open(path, "rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    return {
        "name": path.name,
        "file": path.name,
        "bytes": path.stat().st_size,
        "sha256": sha256,
        "media_type": MEDIA_TYPES[path.suffix],
    }


def to_send(report: Mapping[str, Any], most_bytes: int) -> dict[str, Any]:
    """The report as a message can carry it: without what is in `warning` messages, or can only be very long."""
    left = {name: value for name, value in report.items() if name != "diagnostics"}
    left["diagnostics_count"] = len(report["diagnostics"])
    if len(json.dumps(left)) > most_bytes:
        left["settings"] = {k: v for k, v in left["settings"].items() if k not in ("mask", "load", "variants")}
    return left
