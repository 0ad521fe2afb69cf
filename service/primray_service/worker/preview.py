"""Previews: the current picture in a file that needs no decoder, written by workers and read by the server, which validates it.

Little-endian throughout: the magic, version, sizes of the preview and of the picture, the number of complete passes, total
samples (HEADER), number of channels, each one's name (a length byte, ASCII), and the channels one after another as half floats,
rows from the top. Colours are scene-referred, linear Rec.709, whatever the EXR's colour space; `stderr.*` are their standard
errors, infinite while unknown. A picture of more than a megapixel is averaged over boxes of k x k pixels.
"""

from __future__ import annotations

import math
import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

FILE = "preview.raw"
MAGIC = b"primrayP"
VERSION = 1
HEADER = struct.Struct("<8sIIIIIIQ")
MOST_PIXELS = 2**20
CHANNELS = ("R", "G", "B", "stderr.R", "stderr.G", "stderr.B", "A")
MOST_SIDE = 2**17  # of the picture
HALF_MAX = 65504.0
MOST_BYTES = 4096 + 2 * len(CHANNELS) * MOST_PIXELS

Values = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Preview:
    """A preview. `channels`: (7, H, W) float16 in the order of CHANNELS."""

    channels: Values
    picture: tuple[int, int]  # width and height of the full picture
    passes: int  # increases with every preview of a frame
    samples: int

    @property
    def resolution(self) -> tuple[int, int]:
        return self.channels.shape[2], self.channels.shape[1]

    @property
    def rgb(self) -> Values:
        return self._of(0, 3)

    @property
    def stderr(self) -> Values:
        return self._of(3, 6)

    @property
    def alpha(self) -> Values:
        return self._of(6, 7)[..., 0]

    def _of(self, begin: int, end: int) -> Values:
        """Return (H, W, n) float32."""
        return np.ascontiguousarray(np.moveaxis(self.channels[begin:end], 0, -1), np.float32)


class BadPreview(ValueError):
    """The file is not a preview that this module could have written."""


def preview_of(pixels: Values, errors: Values, passes: int, samples: int) -> Preview:
    """Return a preview of a film's means with coverage (H, W, 4) and standard errors (H, W, 3)."""
    height, width = pixels.shape[:2]
    side = box_side(width, height)
    rgba = _box_mean(pixels, side)
    # The standard error of a mean of n independent pixels is the root of their mean variance over root n.
    counts = _box_counts(height, side)[:, None, None] * _box_counts(width, side)[None, :, None]
    deviation = np.sqrt(_box_mean(np.square(errors), side) / counts) if side > 1 else errors
    stacked = np.concatenate([rgba[..., :3], deviation, rgba[..., 3:]], axis=2)
    with np.errstate(over="ignore"):
        limited = np.where(np.isfinite(stacked), np.clip(stacked, -HALF_MAX, HALF_MAX), stacked)
        halves = np.moveaxis(limited, -1, 0).astype("<f2")
    return Preview(np.ascontiguousarray(halves), (width, height), passes, samples)


def box_side(width: int, height: int) -> int:
    """Return the smallest integer side of a box, in pixels, for which there are at most a megapixel of boxes."""
    side = max(math.isqrt(max(width * height // MOST_PIXELS - 1, 0)), 1)
    while -(-width // side) * -(-height // side) > MOST_PIXELS:
        side += 1
    return side


def _box_counts(length: int, side: int) -> Values:
    counts = np.full(-(-length // side), side, np.float32)
    counts[-1] = length - side * (len(counts) - 1)
    return counts


def _box_mean(values: Values, side: int) -> Values:
    if side == 1:
        return values
    height, width = values.shape[:2]
    rows = np.add.reduceat(values, np.arange(0, height, side), axis=0)
    boxes = np.add.reduceat(rows, np.arange(0, width, side), axis=1)
    mean: Values = boxes / (_box_counts(height, side)[:, None, None] * _box_counts(width, side)[None, :, None])
    return mean


def write_preview(preview: Preview, folder: Path) -> tuple[str, int]:
    """Write the preview's file in the folder atomically; return the file's name and size."""
    width, height = preview.resolution
    head = HEADER.pack(MAGIC, VERSION, width, height, *preview.picture, preview.passes, preview.samples)
    names = b"".join(bytes([len(name)]) + name.encode() for name in CHANNELS)
    data = head + bytes([len(CHANNELS)]) + names + preview.channels.tobytes()
    partial = folder / f".{FILE}.partial"
    partial.write_bytes(data)
    os.replace(partial, folder / FILE)
    return FILE, len(data)


def read_preview(path: Path) -> Preview:
    """Read a preview, following no links; raise BadPreview unless it is valid, FileNotFoundError if it is missing."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(handle, "rb") as file:
        data = file.read(MOST_BYTES + 1)
    return decode_preview(data)


def decode_preview(data: bytes) -> Preview:
    if len(data) > MOST_BYTES:
        raise BadPreview("it is too large")
    if len(data) < HEADER.size + 1:
        raise BadPreview("it ends early")
    magic, version, width, height, full_width, full_height, passes, samples = HEADER.unpack_from(data)
    if magic != MAGIC or version != VERSION:
        raise BadPreview("it does not begin as a preview of this version does")
    if not (0 < full_width <= MOST_SIDE and 0 < full_height <= MOST_SIDE):
        raise BadPreview("its picture has an impossible size")
    side = box_side(full_width, full_height)
    if (width, height) != (-(-full_width // side), -(-full_height // side)):
        raise BadPreview("its size is not that of a preview of its picture")
    names = b"".join(bytes([len(name)]) + name.encode() for name in CHANNELS)
    begin = HEADER.size + 1 + len(names)
    if data[HEADER.size : begin] != bytes([len(CHANNELS)]) + names:
        raise BadPreview("its channels are not those of a preview")
    if len(data) != begin + 2 * len(CHANNELS) * width * height:
        raise BadPreview("its size differs from its header's")
    channels = np.frombuffer(data, "<f2", offset=begin).reshape(len(CHANNELS), height, width)
    if np.isnan(channels).any() or np.isinf(channels[:3]).any() or np.isinf(channels[6]).any():
        raise BadPreview("it contains impossible values")
    return Preview(channels, (full_width, full_height), passes, samples)
