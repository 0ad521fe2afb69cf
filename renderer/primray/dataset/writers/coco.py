"""COCO: annotations.json with a mask, a box and keypoints of each visible thing, and the pictures beside it.

Masks are run lengths down the columns, as pycocotools compresses them; boxes are x, y, width, height from the picture's upper
left corner, so that one pixel has width 1; ids count from 1, because COCOeval never matches an annotation whose id is 0. There
is no date and no licence: two data sets of the same pixels have the same file. (https://cocodataset.org/#format-data)
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import SettingsError
from ..packing import Sample, link

if TYPE_CHECKING:
    from ..config import Config
    from ..document import Entry
    from ..lock_file import Lock

NEEDS_LABELS, NEEDS_PINHOLE, PICTURES, AOVS = True, False, ("png",), ()
FILE, IMAGES = "annotations.json", "images"


def options(entry: Entry | None) -> dict[str, Any]:
    if entry is not None:
        entry.fields()
    return {}


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    """Write annotations.json and images/NNNNNN.png; keypoints are counted from pixels' middles, as in COCO's own data."""
    encode = mask_encoder()
    images, annotations, keypoints = list[Any](), list[Any](), dict[int, list[str]]()
    for sample in samples:
        width, height = sample.resolution
        name = f"{sample.name}.png"
        link(sample.file("picture"), folder / IMAGES / name)
        images.append({"id": sample.index + 1, "file_name": f"{IMAGES}/{name}", "width": width, "height": height})
        for place, thing in enumerate(sample.things):
            mask = sample.mask(place)
            if not mask.any():
                continue
            counts = encode(mask)
            annotation = {
                "id": len(annotations) + 1,
                "image_id": sample.index + 1,
                "category_id": thing["class_id"],
                "segmentation": {"counts": counts, "size": [height, width]},
                "area": int(mask.sum()),
                "bbox": box_of(mask),
                "iscrowd": 0,
                "path": thing["path"],
            }
            if thing["keypoints"]:
                keypoints.setdefault(thing["class_id"], [point["name"] for point in thing["keypoints"]])
                annotation |= _keypoints(thing["keypoints"])
            annotations.append(annotation)
    categories = [
        {"id": number, "name": name, "supercategory": ""}
        | ({"keypoints": keypoints[number], "skeleton": []} if number in keypoints else {})
        for name, number in classes_of(lock, config)
    ]
    says = {
        "info": {"description": config.stage.name},
        "licenses": [],
        "images": images,
        "annotations": annotations,
        "categories": categories,
    }
    (folder / FILE).write_text(json.dumps(says, ensure_ascii=False) + "\n", encoding="utf-8")
    return []


def mask_encoder() -> Any:
    """Return a function from masks (H, W) to pycocotools' texts of run lengths; SettingsError without the package."""
    try:
        from pycocotools import mask as masks
    except ImportError:
        raise SettingsError("COCO needs pycocotools: pip install 'primray[dataset]'", code="dataset-missing") from None
    return lambda mask: masks.encode(np.asfortranarray(mask.astype(np.uint8)))["counts"].decode()


def box_of(mask: np.ndarray[Any, Any]) -> list[int]:
    """Return x, y, width and height of a mask's pixels."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return [int(columns[0]), int(rows[0]), int(columns[-1] - columns[0]) + 1, int(rows[-1] - rows[0]) + 1]


def classes_of(lock: Lock, config: Config) -> list[tuple[str, int]]:
    """Return the classes of the data set's taxonomy with their ids, by id."""
    assert config.labels is not None
    found = json.loads(lock.classes)["classes"].get(config.labels.taxonomy, {}) if lock.classes else {}
    return sorted(found.items(), key=lambda item: int(item[1]))


def _keypoints(points: list[dict[str, Any]]) -> dict[str, Any]:
    """Return x, y, v of each point: 0 not in the picture, 1 hidden, 2 visible."""
    found: list[float] = []
    for point in points:
        x, y = point["pixel"] or (0.5, 0.5)
        v = point["v"] if point["pixel"] is not None else 0
        found += [x - 0.5, y - 0.5, v] if v else [0, 0, 0]
    return {"keypoints": found, "num_keypoints": sum(v > 0 for v in found[2::3])}
