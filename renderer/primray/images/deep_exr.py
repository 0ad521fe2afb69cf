"""Writer of deep EXR files: scanlines, floats, ZIPS. OpenImageIO's Python module sets deep values one by one, a second for a
hundred thousand.

The layout is that of OpenEXR's "File Layout" (deep scan line parts) and of ImfZip.cpp (bytes of odd and even index apart, then
differences).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Floats
from ..errors import PrimrayError
from .deep import CHANNELS, DeepPicture

_MAGIC, _VERSION, _DEEP, _LONG_NAMES = 20000630, 2, 0x800, 0x400
_ZIPS, _FLOAT = 2, 2
_LEVEL = 4  # of zlib, as OpenEXR's own default
# Header attributes of OpenImageIO by name, with the name and type of OpenEXR.
_KNOWN = {
    "chromaticities": ("chromaticities", "chromaticities"),
    "worldtocamera": ("worldToCamera", "m44f"),
    "worldtoNDC": ("worldToNDC", "m44f"),
}
_VECTORS = {("int", 2): "v2i", ("int", 3): "v3i", ("float", 2): "v2f", ("float", 3): "v3f"}


def write_deep(path: str, deep: DeepPicture, spec: Any) -> None:
    """Write a deep EXR with the windows and header attributes of an OpenImageIO `spec`; PrimrayError if that fails."""
    header = b"".join(_header(deep, spec))
    width, rows = deep.counts.shape[1], list(_rows(deep))
    version = _VERSION | _DEEP | _LONG_NAMES
    start = 8 + len(header)
    try:
        with open(path, "wb") as file:
            file.write(struct.pack("<ii", _MAGIC, version) + header)
            file.write(bytes(8 * len(rows)))
            offsets = []
            for y, (counts, values) in enumerate(rows):
                offsets.append(file.tell())
                file.write(_chunk(spec.y + y, counts, values, width))
            file.seek(start)
            file.write(np.asarray(offsets, "<u8").tobytes())
    except OSError as error:
        raise PrimrayError(f"the file cannot be written: {error.strerror}", where=path, code="write-failed") from error


def _rows(deep: DeepPicture) -> Iterator[tuple[npt.NDArray[np.uint32], Floats]]:
    ends = np.cumsum(deep.counts.sum(axis=1, dtype=np.int64))
    for counts, first, end in zip(deep.counts, [0, *ends[:-1]], ends, strict=True):
        yield counts, deep.values[first:end]


def _chunk(y: int, counts: npt.NDArray[np.uint32], values: Floats, width: int) -> bytes:
    table = np.cumsum(counts, dtype="<i4").tobytes()
    assert len(table) == 4 * width
    columns = [values[:, CHANNELS.index(name)] for name in sorted(CHANNELS)]
    data = np.concatenate(columns).astype("<f4").tobytes()
    packed_table, packed = _compressed(table), _compressed(data)
    return struct.pack("<iQQQ", y, len(packed_table), len(packed), len(data)) + packed_table + packed


def _compressed(data: bytes) -> bytes:
    """Return the data as ZIPS compresses it, or as it is where that is not shorter."""
    if not data:
        return data
    raw = np.frombuffer(data, np.uint8)
    halves = np.concatenate([raw[0::2], raw[1::2]])
    differences = np.concatenate([halves[:1], np.diff(halves) + np.uint8(128)])
    packed = zlib.compress(differences.tobytes(), _LEVEL)
    return packed if len(packed) < len(data) else data


def _header(deep: DeepPicture, spec: Any) -> Iterator[bytes]:
    channels = b"".join(name.encode() + b"\0" + struct.pack("<iBxxxii", _FLOAT, 0, 1, 1) for name in sorted(CHANNELS))
    data = struct.pack("<4i", spec.x, spec.y, spec.x + spec.width - 1, spec.y + spec.height - 1)
    whole = struct.pack("<4i", spec.full_x, spec.full_y, spec.full_x + spec.full_width - 1, spec.full_y + spec.full_height - 1)
    yield _attribute("channels", "chlist", channels + b"\0")
    yield _attribute("compression", "compression", bytes([_ZIPS]))
    yield _attribute("dataWindow", "box2i", data)
    yield _attribute("displayWindow", "box2i", whole)
    yield _attribute("lineOrder", "lineOrder", b"\0")
    yield _attribute("pixelAspectRatio", "float", struct.pack("<f", spec.get_float_attribute("PixelAspectRatio", 1.0)))
    yield _attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0))
    yield _attribute("screenWindowWidth", "float", struct.pack("<f", 1))
    yield _attribute("name", "string", b"deep")
    yield _attribute("type", "string", b"deepscanline")
    yield _attribute("version", "int", struct.pack("<i", 1))
    yield _attribute("chunkCount", "int", struct.pack("<i", spec.height))
    yield _attribute("maxSamplesPerPixel", "int", struct.pack("<i", int(deep.counts.max(initial=0))))
    yield _attribute("primray:deep.tolerance", "float", struct.pack("<f", deep.tolerance))
    for attribute in spec.extra_attribs:
        if (made := _as_attribute(attribute)) is not None:
            yield made
    yield b"\0"


def _as_attribute(attribute: Any) -> bytes | None:
    """Return a header attribute of OpenImageIO as OpenEXR stores it; None for those of OpenImageIO alone."""
    name, kind, found = attribute.name, str(attribute.type), attribute.value
    if name in _KNOWN:
        own, type_ = _KNOWN[name]
        return _attribute(own, type_, np.asarray(found, "<f4").tobytes())
    if name.startswith("oiio:") or name in ("compression", "PixelAspectRatio"):
        return None
    if isinstance(found, str):
        return _attribute(name, "string", found.encode("utf-8", "replace"))
    if isinstance(found, int):
        return _attribute(name, "int", struct.pack("<i", found))
    if isinstance(found, float):
        return _attribute(name, "float", struct.pack("<f", found))
    vector = _VECTORS.get((kind.partition("[")[0], len(found)))
    return (
        None if vector is None else _attribute(name, vector, np.asarray(found, "<i4" if vector[-1] == "i" else "<f4").tobytes())
    )


def _attribute(name: str, kind: str, value: bytes) -> bytes:
    return name.encode()[:255] + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
