"""YOLO's poses: as yolo.py, with the keypoints after each box, `px py v` of every name that a thing of the data set has.

Names are in the order of classes, and within a class as they are authored; a thing has 0 0 0 for those that it lacks, and for
keypoints outside of the picture. v is 1 for hidden ones, 2 for visible ones. flip_idx swaps names that differ by left and right
alone; without such names there is none, and Ultralytics does not mirror pictures. (https://docs.ultralytics.com/datasets/pose/)
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..packing import Sample
from .coco import classes_of
from .yolo import AOVS, NEEDS_LABELS, NEEDS_PINHOLE, PICTURES, box_values, options, write_lines

if TYPE_CHECKING:
    from ..config import Config
    from ..lock_file import Lock

__all__ = ["AOVS", "NEEDS_LABELS", "NEEDS_PINHOLE", "PICTURES", "options", "write"]
SIDES = {"left": "right", "Left": "Right", "LEFT": "RIGHT"}


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    of_classes: dict[int, list[str]] = {}
    for thing in (thing for sample in samples for thing in sample.things):
        own = of_classes.setdefault(thing["class_id"], [])
        own += [point["name"] for point in thing["keypoints"] if point["name"] not in own]
    names = list(dict.fromkeys(name for _, own in sorted(of_classes.items()) for name in own))

    def values(sample: Sample, thing: dict[str, Any], mask: Any) -> list[float]:
        return [*box_values(sample, mask), *_values_of_points(thing["keypoints"], names, sample.resolution)]

    write_lines(samples, config, lock, folder, values, _of_names(names, len(classes_of(lock, config))))
    return [] if names else ["no thing has keypoints: its lines are boxes"]


def _values_of_points(points: Sequence[dict[str, Any]], names: Sequence[str], resolution: tuple[int, int]) -> list[float]:
    width, height = resolution
    own = {point["name"]: point for point in points}
    found: list[float] = []
    for name in names:
        point = own.get(name)
        if point is None or point["pixel"] is None or point["v"] == 0:
            found += [0, 0, 0]
        else:
            found += [point["pixel"][0] / width, point["pixel"][1] / height, point["v"]]
    return found


def _of_names(names: Sequence[str], classes: int) -> str:
    """Return what data.yaml says of keypoints."""
    if not names:
        return ""
    listed = "".join(f"    - {json.dumps(name, ensure_ascii=False)}\n" for name in names)
    swapped = [_other_side(name) for name in names]
    text = f"kpt_shape: [{len(names)}, 3]\n"
    if swapped != list(names) and all(name in names for name in swapped):
        text += f"flip_idx: {[names.index(name) for name in swapped]}\n"
    return text + "kpt_names:\n" + "".join(f"  {k}:\n{listed}" for k in range(classes))


def _other_side(name: str) -> str:
    """Return a name with left in place of right, and the other way round."""
    for one, other in (*SIDES.items(), *((b, a) for a, b in SIDES.items())):
        if one in name:
            return name.replace(one, other)
    return name
