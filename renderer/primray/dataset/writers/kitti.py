"""KITTI's object benchmark: training/image_2, training/label_2 and training/calib, a file each for every sample.

A line has 15 columns: type, truncated, occluded, alpha, left, top, right, bottom, height, width, length, x, y, z, rotation_y.
Pixels count from 0 at the middle of the upper left one, and are those of the visible box; lengths are metres, in the camera's
axes (x right, y down, z forward); the place is the middle of the bottom face. Only a turn about y exists: a box that is pitched
in the camera has no form there, and the upright box that holds it is written. occluded is 0 below 0.1 hidden, 1 to 0.5, 2
above, 3 where it is unknown: KITTI's were judged by people. (A. Geiger, P. Lenz, R. Urtasun 2012, devkit_object's readme)
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..packing import Sample, check_pinhole, link

if TYPE_CHECKING:
    from ...arrays import Doubles
    from ..config import Config
    from ..document import Entry
    from ..lock_file import Lock

NEEDS_LABELS, NEEDS_PINHOLE, PICTURES, AOVS = True, True, ("png",), ()
PITCHED = 1e-3  # a box whose axis is off the camera's y by more, in sine, is loosened
NOTHING = "-1 -1 -1 -1000 -1000 -1000 -10"


def options(entry: Entry | None) -> dict[str, Any]:
    if entry is not None:
        entry.fields()
    return {}


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    base = folder / "training"
    for name in ("label_2", "calib"):
        (base / name).mkdir(parents=True)
    loosened = flat = 0
    for sample in samples:
        check_pinhole("KITTI", sample)
        link(sample.file("picture"), base / "image_2" / f"{sample.name}.png")
        lines = []
        for thing in sample.things:
            if thing["box_tight"] is None:
                continue
            box = thing["box_3d"]
            upright = None if box is None else upright_box(np.array(box["camera_from_box"]), np.array(box["size"]))
            metres = 1.0 if box is None else _metres(box)
            flat += upright is None
            loosened += upright is not None and upright[3]
            lines.append(line_of(thing, upright, metres))
        (base / "label_2" / f"{sample.name}.txt").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        (base / "calib" / f"{sample.name}.txt").write_text(_calibration(sample), encoding="utf-8")
    notes = [f"{loosened} pitched boxes are the upright boxes that hold them"] if loosened else []
    return notes + ([f"{flat} things have no 3-D box"] if flat else [])


def _metres(box: dict[str, Any]) -> float:
    """Return metres per scene unit, of a box's sizes in both."""
    ratios = [m / s for m, s in zip(box["size_m"], box["size"], strict=True) if s > 0]
    return ratios[0] if ratios else 1.0


def upright_box(camera_from_box: Doubles, size: Doubles) -> tuple[Doubles, Doubles, float, bool]:
    """Return the least box about the camera's y axis that holds a box, with its length along the longest level axis.

    The middle of its bottom face, its height, width and length, rotation_y, and whether it is larger than the box.
    """
    rotation, center = camera_from_box[:3, :3], camera_from_box[:3, 3]
    level = [k for k in range(3) if k != int(np.argmax(np.abs(rotation[1])))]
    along = rotation[:, max(level, key=lambda k: size[k])]
    turn = math.atan2(
        -along[2], along[0]
    )  # rotation_y 0: the length is along +x, KITTI's R = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    axes = np.array([[math.cos(turn), 0, -math.sin(turn)], [0, 1, 0], [math.sin(turn), 0, math.cos(turn)]])
    half = np.abs(axes @ rotation) @ (size / 2)
    bottom = center + [0, half[1], 0]
    upright = float(np.abs(rotation[1]).max())
    return bottom, 2 * half[[1, 2, 0]], turn, math.sqrt(max(0.0, 1 - upright * upright)) > PITCHED


def line_of(thing: dict[str, Any], upright: Any, metres: float) -> str:
    kind = "_".join(str(thing["class"]).split()) or "Misc"  # blanks part columns
    truncated = "-1" if thing["truncation"] is None else f"{thing['truncation']:.2f}"
    x0, y0, x1, y1 = thing["box_tight"]
    box = f"{x0 - 0.5:.2f} {y0 - 0.5:.2f} {x1 - 0.5:.2f} {y1 - 0.5:.2f}"
    if upright is None:
        return f"{kind} {truncated} {occluded(thing['occlusion'])} -10 {box} {NOTHING}"
    bottom, sizes, turn, _ = upright
    alpha = wrapped(turn - math.atan2(bottom[0], bottom[2]))
    numbers = [*(sizes * metres), *(bottom * metres), wrapped(turn)]
    return f"{kind} {truncated} {occluded(thing['occlusion'])} {alpha:.4f} {box} " + " ".join(f"{n:.4f}" for n in numbers)


def occluded(ratio: float | None) -> int:
    return 3 if ratio is None else 0 if ratio < 0.1 else 1 if ratio <= 0.5 else 2


def wrapped(angle: float) -> float:
    """Return an angle from -pi to pi."""
    return math.atan2(math.sin(angle), math.cos(angle))


def _calibration(sample: Sample) -> str:
    """Return calib/NNNNNN.txt: the same camera four times, no rectification, and a lidar at the camera."""
    k = np.array(sample.record["camera"]["intrinsics"])
    p = np.column_stack([k, np.zeros(3)])
    velo = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]])  # x forward, y left, z up
    rows = [(f"P{n}", p) for n in range(4)] + [
        ("R0_rect", np.eye(3)),
        ("Tr_velo_to_cam", velo),
        ("Tr_imu_to_velo", np.eye(4)[:3]),
    ]
    return "".join(f"{name}: " + " ".join(f"{value:.12e}" for value in np.ravel(matrix)) + "\n" for name, matrix in rows)
