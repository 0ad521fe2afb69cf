"""YOLO: images/train/NNNNNN.png, labels/train/NNNNNN.txt with a line of each visible thing, and data.yaml.

A line is `class xc yc w h`: the class counts from 0 in the order of the table's ids, the box is that of the visible pixels, by
the picture's width and height. Pictures without things have an empty file. Segments and keypoints are formats of their own, as
each of Ultralytics' tasks reads lines of one kind. (https://docs.ultralytics.com/datasets/detect/)
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..packing import Sample, link
from .coco import box_of, classes_of

if TYPE_CHECKING:
    from ..config import Config
    from ..document import Entry
    from ..lock_file import Lock

NEEDS_LABELS, NEEDS_PINHOLE, PICTURES, AOVS = True, False, ("png",), ()
Values = Callable[[Sample, dict[str, Any], Any], Iterable[float]]  # of a sample's thing with its mask (H, W)


def options(entry: Entry | None) -> dict[str, Any]:
    if entry is not None:
        entry.fields()
    return {}


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    write_lines(samples, config, lock, folder, lambda sample, _, mask: box_values(sample, mask))
    return []


def write_lines(samples: Iterable[Sample], config: Config, lock: Lock, folder: Path, values: Values, more: str = "") -> None:
    """Write all files: a line of each visible thing has its class and its `values`; data.yaml ends with `more`."""
    classes = classes_of(lock, config)
    numbers = {number: k for k, (_, number) in enumerate(classes)}
    labels = folder / "labels/train"
    labels.mkdir(parents=True)
    for sample in samples:
        link(sample.file("picture"), folder / "images/train" / f"{sample.name}.png")
        lines = []
        for place, thing in enumerate(sample.things):
            mask = sample.mask(place)
            if mask.any():
                own = " ".join(f"{value:.9g}" for value in values(sample, thing, mask))
                lines.append(f"{numbers[thing['class_id']]} {own}")
        (labels / f"{sample.name}.txt").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    names = "".join(f"  {k}: {json.dumps(name, ensure_ascii=False)}\n" for k, (name, _) in enumerate(classes))
    listed = f"names:\n{names}" if names else "names: {}\n"
    text = f"path: .\ntrain: images/train\nval: images/train\n{listed}{more}"
    (folder / "data.yaml").write_text(text, encoding="utf-8")


def box_values(sample: Sample, mask: Any) -> tuple[float, ...]:
    """Return the middle, width and height of a mask's box, as shares of the picture's."""
    width, height = sample.resolution
    x, y, w, h = box_of(mask)
    return (x + w / 2) / width, (y + h / 2) / height, w / width, h / height
