"""YOLO's segments: as yolo.py, but a line is `class x1 y1 x2 y2 ...`, one polygon around a thing's visible pixels.

Coordinates are shares of the picture's width and height. The format has one polygon a thing: parts and holes are joined by
seams there and back, as Ultralytics joins the polygons of COCO. Its boxes are those of the polygons, so a quarter of a pixel
narrower on each side than the pixels are. (https://docs.ultralytics.com/datasets/segment/)
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..packing import Sample
from .outlines import polygon_of
from .yolo import AOVS, NEEDS_LABELS, NEEDS_PINHOLE, PICTURES, options, write_lines

if TYPE_CHECKING:
    from ..config import Config
    from ..lock_file import Lock

__all__ = ["AOVS", "NEEDS_LABELS", "NEEDS_PINHOLE", "PICTURES", "options", "write"]


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    write_lines(samples, config, lock, folder, lambda sample, _, mask: (polygon_of(mask) / sample.resolution).ravel())
    return []
