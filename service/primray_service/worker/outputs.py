"""The files that a frame leaves, by the endings of their names: .exr is the record, .png a view of it, .json the report."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from primray.images.files.encoding import Encoding

from .channel import finite

if TYPE_CHECKING:
    from primray.diagnostics import Diagnostics
    from primray.images.image import Image

MEDIA_TYPES = {".exr": "image/x-exr", ".png": "image/png", ".json": "application/json"}
DEFAULT_NAMES = ("beauty.exr", "beauty.png", "report.json")


def write_pictures(image: Image, names: Sequence[str], folder: Path, diagnostics: Diagnostics) -> dict[str, Any]:
    """The report, with what writing took; what a view does not show well goes to `diagnostics`. Records come first: of a view
    that fails nothing else is lost."""
    from primray.images.exposure import view_fault
    from primray.images.image import faults_of_exr
    from primray.report.unfinished import kept_without

    start, view, stops = time.perf_counter(), image.view_of(), image.file.view.exposure
    for name in sorted(names, key=lambda name: not name.endswith(".exr")):
        if name.endswith(".exr"):
            image.write(folder / name, view, 0.0)
            diagnostics.extend(faults_of_exr(image, Encoding()))
        elif not name.endswith(".json"):
            with kept_without(name, diagnostics):
                image.write(folder / name, view, stops)
                faults = (view.assumption(), view_fault(image.shown.pixels, view, stops))
                diagnostics.extend(fault for fault in faults if fault is not None)
    stages_s = {**image.report["stages_s"], "write": time.perf_counter() - start}
    return {**image.report, "outputs": list(names), "stages_s": stages_s}


def write_report(report: Mapping[str, Any], names: Sequence[str], folder: Path) -> None:
    text = json.dumps(finite(report), indent=2, ensure_ascii=False) + "\n"
    for name in names:
        if name.endswith(".json"):
            (folder / name).write_text(text, encoding="utf-8")


def described(path: Path) -> dict[str, Any]:
    """What `done` says of a file."""
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
