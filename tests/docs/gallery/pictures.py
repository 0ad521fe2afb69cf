"""The gallery's pictures and what is recorded of them. `python -m tests.docs.gallery.pictures [NAME ...]` renders them anew.

docs/gallery/NAME.jpg, NAME-small.jpg (for README.md) and, of the Cornell box, cornell-error.jpg; docs/gallery/pictures.json has
of each its error, samples and seconds, and what of the stage it was made of.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

import primray
from primray.images.showing import heat, relative_errors

from .scenes import FOLDER, NAMED, SHOWN, Shown

RECORD = FOLDER / "pictures.json"
SMALL = 400  # pixels wide


def records() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    return found


def stage_sha256(shown: Shown) -> str:
    """Of all files that the stage is made of, its generator aside."""
    beside = sorted(shown.path.parent.glob("*")) if shown.path.name == "scene.usda" else [shown.path]
    digest = hashlib.sha256()
    for file in beside:
        if file.is_file() and file.suffix != ".py":
            digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def small(picture: Path, to: Path) -> None:
    shown = oiio.ImageBuf(str(picture))
    height = round(SMALL * shown.spec().height / shown.spec().width)
    resized = oiio.ImageBufAlgo.resize(shown, filtername="lanczos3", roi=oiio.ROI(0, SMALL, 0, height, 0, 1, 0, 3))
    resized.specmod().attribute("Compression", "jpeg:85")
    if not resized.write(str(to)):
        raise OSError(resized.geterror())


def jpeg(image: primray.Image, to: Path, exposure: float) -> None:
    """With less loss than a command's JPEG would have."""
    with tempfile.TemporaryDirectory() as folder:
        shown = oiio.ImageBuf(str(image.save(Path(folder) / "picture.png", exposure=exposure)))
        shown.specmod().attribute("Compression", "jpeg:92")
        if not shown.write(str(to)):
            raise OSError(shown.geterror())


def error_picture(image: primray.Image, to: Path) -> None:
    assert image.errors is not None
    errors = relative_errors(image.pixels, image.errors)
    assert errors is not None
    shown = oiio.ImageBuf(np.ascontiguousarray(heat(errors)))
    shown.specmod().attribute("Compression", "jpeg:92")
    if not shown.write(str(to)):
        raise OSError(shown.geterror())


def record(shown: Shown, report: Mapping[str, Any]) -> dict[str, Any]:
    low, high = report["samples_per_pixel"]
    kept = {
        "command": shown.command,
        "relmse": report["error"]["relmse"],
        "display": report["error"]["display"],
        "samples_per_pixel": [low, high, round(report["samples"] / (shown.resolution[0] * shown.resolution[1]))],
        "cpu_s": round(report["cpu_total_s"], 1),
        "isa": report["isa"],
        "pixels_sha256": report["pixels_sha256"],
        "stage_sha256": stage_sha256(shown),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
    }
    if shown.denoised:
        kept["denoised_relmse"] = report["denoised"]["error"]["relmse"]
    return kept


def render(shown: Shown) -> dict[str, Any]:
    image = primray.render(
        shown.path,
        resolution=shown.resolution,
        target_error=shown.target,
        spp=shown.spp,
        denoise=shown.denoised,
        time_code=shown.frame,
    )
    jpeg(image, FOLDER / f"{shown.name}.jpg", shown.exposure)
    small(FOLDER / f"{shown.name}.jpg", FOLDER / f"{shown.name}-small.jpg")
    if shown.name == "cornell":
        error_picture(image, FOLDER / "cornell-error.jpg")
    return record(shown, image.report)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="all, unless said")
    for name in parser.parse_args().names or [shown.name for shown in SHOWN]:
        made = render(NAMED[name])
        RECORD.write_text(json.dumps(dict(sorted((records() | {name: made}).items())), indent=2) + "\n", encoding="utf-8")
        print(name, json.dumps(made, indent=2))


if __name__ == "__main__":
    main()
