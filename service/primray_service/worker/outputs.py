"""Output files of a frame, by their extensions: .exr is the record, .png a view of it, .json the report.

The job's settings give the view, exposure, half floats and compression.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from primray.images.encoding import Encoding, compression_of

from .channel import finite

if TYPE_CHECKING:
    from primray.diagnostics import Diagnostics
    from primray.images.exposure import View
    from primray.images.image import Image


MEDIA_TYPES = {
    ".exr": "image/x-exr",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".tif": "image/tiff",
    ".tiff": "image/tiff",
    ".hdr": "image/vnd.radiance",
    ".json": "application/json",
}
DEFAULT_NAMES = ("beauty.exr", "beauty.png", "report.json")


def write_pictures(
    image: Image, names: Sequence[str], folder: Path, diagnostics: Diagnostics, files: PictureFiles
) -> dict[str, Any]:
    """Write the pictures and return the report with the time for writing; view problems go to `diagnostics`.

    EXRs come first, so that a view that fails loses nothing else.
    """
    start = time.perf_counter()
    for name in sorted(names, key=lambda name: not name.endswith(".exr")):
        if not name.endswith(".json"):
            write_picture(image, folder / name, diagnostics, files)
    stages_s = {**image.report["stages_s"], "write": time.perf_counter() - start}
    return {**image.report, "outputs": list(names), "stages_s": stages_s}


def write_picture(image: Image, path: Path, diagnostics: Diagnostics, files: PictureFiles) -> None:
    """Write one file; a view that cannot be made is reported and the file is left out."""
    from primray.diagnostics import kept_without
    from primray.images.image import faults_of_exr, shows_view

    view = files.view_of(image)
    if not shows_view(path, files.encoding):
        image.write(path, view, 0.0, files.encoding)
        if path.suffix.lower() == ".exr":
            diagnostics.extend(faults_of_exr(image, files.encoding))
        return
    with kept_without(path.name, diagnostics):
        stops = files.stops(image)
        image.write(path, view, stops, files.encoding)
        faults = (view.assumption(), image.view_fault(view, stops, is_auto=files.exposure == "auto"))
        diagnostics.extend(fault for fault in faults if fault is not None)


def write_report(report: Mapping[str, Any], names: Sequence[str], folder: Path) -> None:
    text = json.dumps(finite(report), indent=2, ensure_ascii=False) + "\n"
    for name in names:
        if name.endswith(".json"):
            (folder / name).write_text(text, encoding="utf-8")


def described(path: Path) -> dict[str, Any]:
    """Return the description of a file for `done`."""
    with open(path, "rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    return {
        "name": path.name,
        "file": path.name,
        "bytes": path.stat().st_size,
        "sha256": sha256,
        "media_type": MEDIA_TYPES[path.suffix.lower()],
    }


def to_send(report: Mapping[str, Any], most_bytes: int) -> dict[str, Any]:
    """Return the report as a message can carry it: without what `warning` messages have, and without members that are too
    long."""
    left = {name: value for name, value in report.items() if name != "diagnostics"}
    left["diagnostics_count"] = len(report["diagnostics"])
    if len(json.dumps(left)) > most_bytes:
        left["settings"] = {k: v for k, v in left["settings"].items() if k not in ("mask", "load", "variants")}
    return left


@dataclass(frozen=True)
class PictureFiles:
    """OpenColorIO transform of pictures, and storage of an EXR."""

    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float | Literal["auto"] | None = None  # None: as the product asks
    encoding: Encoding = field(default_factory=Encoding)

    def view_of(self, image: Image) -> View:
        """Return the view of the image's files: the job's, else the one that the stage's product requests."""
        return image.view_of(self.view, self.display, self.look)

    def stops(self, image: Image) -> float:
        """Return the exposure in stops; "auto" is what the view needs for this picture."""
        if self.exposure is None:
            return image.file.view.exposure
        if self.exposure != "auto":
            return self.exposure
        from primray.images.exposure import exposure_that_serves

        return exposure_that_serves(image.seen, self.view_of(image))


def picture_files_of(command: Mapping[str, Any]) -> PictureFiles:
    """Return the command's `files`; SettingsError for a compression that EXR does not have."""
    said = command.get("files") or {}
    encoding = Encoding(None, tuple(said.get("half", ())), *compression_of(said.get("compression")))
    return PictureFiles(said.get("view"), said.get("display"), said.get("look"), said.get("exposure"), encoding)
