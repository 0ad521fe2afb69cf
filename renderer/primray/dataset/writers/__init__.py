"""Formats of data sets: a module each, which writes a folder of all samples, in their order.

A module has NEEDS_LABELS and PICTURES (the kinds of pictures that it needs of each sample), `options(entry)`, which reads its
part of a config, and `write(samples, config, lock, options, folder)`, which returns sentences on what the format cannot hold.

coco.py   annotations.json with masks as run lengths
hdf5.py   one file of arrays
kitti.py  labels, calibration and pictures of the object benchmark
bop.py    poses of objects in a camera
yolo.py   boxes as texts
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

WRITERS: dict[str, Any] = {}


def _register(*modules: ModuleType) -> None:
    for module in modules:
        WRITERS[module.__name__.rpartition(".")[2]] = module
