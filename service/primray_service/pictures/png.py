"""8-bit pixels as a PNG file in memory (https://www.w3.org/TR/png-3/): one filter for all rows, fast compression."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

SIGNATURE = b"\x89PNG\r\n\x1a\n"
COLOR_TYPES = {1: 0, 3: 2, 4: 6}  # channels -> table 8: greyscale, truecolour, truecolour with alpha
FILTER_UP = 2
COMPRESSION = 1  # noise hardly compresses, so speed matters more


def png(values: npt.NDArray[Any]) -> bytes:
    """Return a PNG of (H, W, C) uint8 with 1, 3 or 4 channels."""
    height, width, channels = values.shape
    rows = values.reshape(height, width * channels)
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    filtered[:, 0] = FILTER_UP
    filtered[0, 1:] = rows[0]
    np.subtract(rows[1:], rows[:-1], out=filtered[1:, 1:])  # modulo 256, as the filter requires
    header = struct.pack(">IIBBBBB", width, height, 8, COLOR_TYPES[channels], 0, 0, 0)
    srgb = _chunk(b"sRGB", b"\0")
    body = zlib.compress(filtered.tobytes(), COMPRESSION)
    return SIGNATURE + _chunk(b"IHDR", header) + srgb + _chunk(b"IDAT", body) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
