"""Formats of data sets: a module each, which writes a folder of all samples, in their order.

A module has NEEDS_LABELS, NEEDS_PINHOLE, PICTURES and AOVS (what it needs of each sample), `options(entry)`, which reads its
part of a config, and `write(samples, config, lock, options, folder)`, which returns sentences on what the format cannot hold.
It may iterate over the samples more than once.

coco.py   annotations.json with masks as run lengths
hdf5.py   one file of arrays
kitti.py  labels, calibration and pictures of the object benchmark
bop.py    poses of objects in a camera; bop_models.py has their models
yolo.py   boxes as texts; yolo_segment.py and yolo_pose.py have polygons, and boxes with keypoints
"""

from __future__ import annotations

from typing import Any

from . import bop, coco, hdf5, kitti, yolo, yolo_pose, yolo_segment

WRITERS: dict[str, Any] = {
    "coco": coco,
    "kitti": kitti,
    "bop": bop,
    "yolo": yolo,
    "yolo-segment": yolo_segment,
    "yolo-pose": yolo_pose,
    "hdf5": hdf5,
}
