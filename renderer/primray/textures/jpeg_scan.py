"""Detection of zeroed coefficients in a JPEG, which a copy or a disk left with a hole.

JPEG has no checksums, and libjpeg silently decodes a run of zeros as codewords. By a file's own Huffman tables such a run
either encodes no change, as flat areas do, or gives every coefficient of block after block the same value, which no picture
has (ITU-T T.81: B.1 markers, C the order of codewords, F.1.2.2 coefficients).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

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
