"""Files of raw pictures: DNG (Adobe's Digital Negative: a TIFF with the tags of a mosaic), PNG, TIFF, NumPy arrays."""

from __future__ import annotations

import struct
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ..color.color_space import REC709, xyz_from_rgb
from ..errors import PrimrayError
from ..images.image import replacing
from .model import RawImage

# TIFF's field types.
BYTE, ASCII, SHORT, LONG, RATIONAL, SRATIONAL = 1, 2, 3, 4, 5, 10
_FORMS = {BYTE: "B", ASCII: "B", SHORT: "H", LONG: "I", RATIONAL: "I", SRATIONAL: "i"}
CFA, LINEAR_RAW, D65 = 32803, 34892, 21


def write(raw: RawImage, path: Path) -> Path:
    with replacing(path) as temporary:
        WRITERS[path.suffix.lower()](raw, temporary)
    return path


def _write_dng(raw: RawImage, path: str) -> None:
    Path(path).write_bytes(dng(raw))


def _write_plain(raw: RawImage, path: str) -> None:
    import OpenImageIO as oiio

    height, width = raw.values.shape
    file = oiio.ImageOutput.create(path)
    spec = oiio.ImageSpec(width, height, 1, oiio.UINT16)
    spec.attribute("oiio:ColorSpace", "data")
    if file is None or not file.open(path, spec) or not file.write_image(np.ascontiguousarray(raw.values[..., None])):
        raise PrimrayError(f"the file cannot be written: {oiio.geterror()}", where=path, code="write-failed")
    file.close()


def _write_array(raw: RawImage, path: str) -> None:
    with Path(path).open("wb") as file:
        np.save(file, raw.values)


WRITERS: dict[str, Callable[[RawImage, str], None]] = {
    ".dng": _write_dng,
    ".png": _write_plain,
    ".tif": _write_plain,
    ".tiff": _write_plain,
    ".npy": _write_array,
}


def dng(raw: RawImage) -> bytes:
    """Return a DNG 1.4 file: the same bytes for the same numbers, without a date."""
    model = raw.model
    height, width = raw.values.shape
    is_mono = model.mosaic == "MONO"
    pixels = raw.values.astype("<u2").tobytes()
    tags: list[tuple[int, int, Any]] = [
        (254, LONG, [0]),  # NewSubfileType: the main picture
        (256, LONG, [width]),
        (257, LONG, [height]),
        (258, SHORT, [16]),
        (259, SHORT, [1]),  # Compression: none
        (262, SHORT, [LINEAR_RAW if is_mono else CFA]),
        (271, ASCII, "primray"),
        (272, ASCII, "primray sensor"),
        (273, LONG, [0]),  # StripOffsets, filled in below
        (274, SHORT, [1]),
        (277, SHORT, [1]),
        (278, LONG, [height]),
        (279, LONG, [len(pixels)]),
        (284, SHORT, [1]),
        (50706, BYTE, [1, 4, 0, 0]),  # DNGVersion
        (50707, BYTE, [1, 1, 0, 0]),  # DNGBackwardVersion
        (50708, ASCII, "primray sensor"),  # UniqueCameraModel
        (50713, SHORT, [1, 1]),  # BlackLevelRepeatDim
        (50714, LONG, [model.black_level]),
        (50717, LONG, [model.white_level]),
    ]
    if not is_mono:
        tags += [
            (33421, SHORT, [2, 2]),  # CFARepeatPatternDim
            (33422, BYTE, ["RGB".index(letter) for letter in model.mosaic]),
            (50710, BYTE, [0, 1, 2]),  # CFAPlaneColor
            (50711, SHORT, [1]),  # CFALayout: a rectangle
            (50721, SRATIONAL, _rationals(_camera_from_xyz(raw).ravel())),  # ColorMatrix1
            (50728, RATIONAL, _rationals(_neutral(raw))),  # AsShotNeutral
            (50778, SHORT, [D65]),  # CalibrationIlluminant1
        ]
    return _tiff(sorted(tags, key=lambda tag: tag[0]), pixels)


def _camera_from_xyz(raw: RawImage) -> Any:
    return np.asarray(raw.model.camera_from_rec709) @ np.linalg.inv(xyz_from_rgb(REC709.gamut))


def _neutral(raw: RawImage) -> Any:
    """Return what the filters let through of white, its largest as 1."""
    seen = np.asarray(raw.model.camera_from_rec709) @ np.ones(3)
    return np.maximum(seen, 1e-6) / max(float(seen.max()), 1e-6)


def _rationals(values: Any) -> list[int]:
    fractions = [Fraction(float(value)).limit_denominator(1_000_000) for value in values]
    return [number for f in fractions for number in (f.numerator, f.denominator)]


def _tiff(tags: list[tuple[int, int, Any]], pixels: bytes) -> bytes:
    """Return a little-endian TIFF of one directory, followed by its long values and the pixels."""
    packed = [(number, kind, *_packed(kind, values)) for number, kind, values in tags]
    beyond = 8 + 2 + 12 * len(packed) + 4
    long, entries = b"", b""
    places = {}
    for number, _, _, data in packed:
        if len(data) > 4:
            places[number] = beyond + len(long)
            long += data + b"\0" * (len(data) % 2)
    start = beyond + len(long)
    for number, kind, count, data in packed:
        if number == 273:
            data = struct.pack("<I", start)
        value = struct.pack("<I", places[number]) if len(data) > 4 else data.ljust(4, b"\0")
        entries += struct.pack("<HHI", number, kind, count) + value
    return b"II*\0" + struct.pack("<IH", 8, len(packed)) + entries + struct.pack("<I", 0) + long + pixels


def _packed(kind: int, values: Any) -> tuple[int, bytes]:
    """Return the number of values of a field, and its bytes."""
    if kind == ASCII:
        data = values.encode("ascii") + b"\0"
        return len(data), data
    data = struct.pack(f"<{len(values)}{_FORMS[kind]}", *values)
    return len(values) // (2 if kind in (RATIONAL, SRATIONAL) else 1), data
