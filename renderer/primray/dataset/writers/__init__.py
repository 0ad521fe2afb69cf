"""Formats of data sets: a module each, which writes a folder of all samples, in their order.

A module has NEEDS_LABELS, PICTURES and AOVS (what it needs of each sample), `options(entry)`, which reads its
part of a config, and `write(samples, config, lock, options, folder)`, which returns sentences on what the format cannot hold.

coco.py   annotations.json with masks as run lengths
hdf5.py   one file of arrays
kitti.py  labels, calibration and pictures of the object benchmark
bop.py    poses of objects in a camera
yolo.py   boxes as texts
"""

from __future__ import annotations

from typing import Any

from . import bop, coco, hdf5, kitti, yolo

WRITERS: dict[str, Any] = {"coco": coco, "kitti": kitti, "bop": bop, "yolo": yolo, "hdf5": hdf5}
