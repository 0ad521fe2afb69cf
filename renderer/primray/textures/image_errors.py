"""Errors of OpenImageIO while reading or writing, and damage to JPEGs that it does not report.

Messages of OpenImageIO quote the file, whose bytes may not be text. libjpeg fills missing parts with grey and only warns,
which OpenImageIO stores as an error although it returns pixels: for other formats it returns none.

JPEG has no checksums, and libjpeg silently decodes a run of zeros, which a copy or a disk may leave as a hole, as codewords.
By a file's own Huffman tables such a run either encodes no change, as flat areas do, or gives every coefficient of block after
block the same value, which no picture has (ITU-T T.81: B.1 markers, C the order of codewords, F.1.2.2 coefficients).
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from typing import Any

END_OF_JPEG = b"\xff\xd9"  # the marker EOI: ITU-T T.81, B.2.1
# Warnings of libjpeg (jerror.h) that do not affect pixels.
_HARMLESS = (
    "extraneous bytes before marker",
    "unknown JFIF revision number",
    "Unknown Adobe color transform code",
    "Invalid SOS parameters for sequential JPEG",
    "bad ICC marker",
)
_ENDS_EARLY = "Premature end of JPEG file"


def last_error(source: Any) -> str:
    """Return the error of OpenImageIO, or of one of its objects, on one line; this clears it."""
    try:
        return "; ".join(map(str.strip, str(source.geterror()).strip().splitlines()))
    except UnicodeDecodeError:
        return "its header contains bytes that are not text"


def fault_of_pixels(image: Any, path: str) -> str:
    """Return why the pixels that `image` just returned are not the file's, "" where they are; this clears its error.

    `image` is an OpenImageIO ImageInput. Progressive JPEGs are decoded when they are opened, so errors since then count.
    """
    if not image.has_error:
        return _hole(path) if image.format_name() == "jpeg" else ""
    message = last_error(image)
    if image.format_name() != "jpeg":
        return message
    if _ENDS_EARLY in message:
        return _hole(path) if _lacks_only_its_end(path) else message
    if any(harmless in message for harmless in _HARMLESS):
        return _hole(path) if _has_end(path) else _ENDS_EARLY  # OpenImageIO keeps only the first warning
    return message


def _hole(path: str) -> str:
    with open(path, "rb") as file:
        at = zeroed_part(file.read())
    return "" if at is None else f"its coefficients are zeros from byte {at} on"


def _has_end(path: str) -> bool:
    with open(path, "rb") as file:
        return END_OF_JPEG in file.read()[-4096:]


def _lacks_only_its_end(path: str) -> bool:
    """Return whether all pixels of a JPEG exist and only its end marker is missing: some cameras omit it."""
    import OpenImageIO as oiio

    with open(path, "rb") as file, tempfile.NamedTemporaryFile(suffix=".jpg") as whole:
        whole.write(file.read() + END_OF_JPEG)
        whole.flush()
        again = oiio.ImageInput.open(whole.name)
        if again is None:
            last_error(oiio)
            return False
        try:
            return again.read_image(0, 0, 0, again.spec().nchannels, oiio.UINT8) is not None and not again.has_error
        finally:
            again.close()


_LEAST = 64  # bytes: more than two whole blocks of coefficients in the shortest codewords
_SEQUENTIAL, _PROGRESSIVE = (0xC0, 0xC1), 0xC2
_DHT, _SOI, _EOI, _SOS = 0xC4, 0xD8, 0xD9, 0xDA
_NEXT_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])", re.DOTALL)  # excluding stuffed bytes and restart markers
_ZEROS = re.compile(rb"\0+")
_HOLE = b"\0" * _LEAST


def zeroed_part(data: bytes) -> int | None:
    """Return the offset of zeros in a JPEG that cannot be valid coefficients, None where there are none."""
    if _HOLE not in data:
        return None
    tables: dict[int, int] = {}  # by class and number: the first symbol, whose codeword is all zeros
    frame, blocks = 0, 0
    for marker, start, end in _segments(data):
        if marker == _DHT:
            tables.update(_first_symbols(data[start:end]))
        elif marker in (*_SEQUENTIAL, _PROGRESSIVE):
            frame, blocks = marker, _blocks(data[start:end])
        elif marker == _SOS:
            last = _end_of_scan(data, end)
            scan = data.find(_HOLE, end, last)
            zeros = _ZEROS.match(data, scan, last) if scan >= 0 and frame else None
            # A flat picture's codewords need less than two bytes per block.
            if zeros and (_is_hole(data[start:end], tables, frame) or len(zeros[0]) > 2 * blocks):
                return scan
    return None


def _segments(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield each marker with the start and end of its parameters."""
    at = 2
    while (found := _NEXT_MARKER.search(data, at)) is not None and found[1][0] != _EOI:
        marker, start = found[1][0], found.end()
        if marker == _SOI or marker == 0x01:  # markers without parameters
            at = start
            continue
        end = start + int.from_bytes(data[start : start + 2], "big")
        yield marker, start + 2, end
        at = _end_of_scan(data, end) if marker == _SOS else end


def _end_of_scan(data: bytes, at: int) -> int:
    found = _NEXT_MARKER.search(data, at)
    return found.start() if found is not None else len(data)


def _blocks(frame: bytes) -> int:
    """Return an upper bound for the number of 8 x 8 blocks in all components of a frame."""
    if len(frame) < 6:
        return 0
    height, width = int.from_bytes(frame[1:3], "big"), int.from_bytes(frame[3:5], "big")
    return ((height + 15) // 8) * ((width + 15) // 8) * frame[5]


def _first_symbols(tables: bytes) -> Iterator[tuple[int, int]]:
    at = 0
    while at + 17 < len(tables):
        yield tables[at], tables[at + 17]
        at += 17 + sum(tables[at + 1 : at + 17])


def _is_hole(header: bytes, tables: dict[int, int], frame: int) -> bool:
    """Return whether zeros in a scan give coefficients values, instead of ending blocks or being bits of values."""
    count = header[0] if header else 0
    if len(header) < 4 + 2 * count:
        return False
    first, precision = header[1 + 2 * count], header[3 + 2 * count] >> 4
    if frame == _PROGRESSIVE and (first == 0 or precision):
        return False
    symbols = [tables.get(0x10 | header[2 + 2 * i] & 15, 0) for i in range(count)]
    return any(symbol & 15 for symbol in symbols)
