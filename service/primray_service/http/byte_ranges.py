"""Parser of Range headers (RFC 9110, section 14). Pure."""

from __future__ import annotations

import re
from dataclasses import dataclass

MOST_RANGES = 32
_SPEC = re.compile(r"\s*(\d{0,20})\s*-\s*(\d{0,20})\s*", re.ASCII)


@dataclass(frozen=True)
class ByteRange:
    begin: int
    end: int  # exclusive

    @property
    def size(self) -> int:
        return self.end - self.begin

    def content_range(self, total: int) -> str:
        return f"bytes {self.begin}-{self.end - 1}/{total}"


def byte_ranges(header: str | None, total: int) -> list[ByteRange] | None:
    """Return the requested ranges of a file of `total` bytes, merged where they touch, in the order of their beginnings.

    None: the header is ignored (another unit, malformed, or so many ranges that the whole file is less work); an empty list: no
    requested range exists (416).
    """
    if header is None:
        return None
    unit, _, specs = header.partition("=")
    if unit.strip().lower() != "bytes":
        return None
    parts = specs.split(",")
    if len(parts) > MOST_RANGES:
        return None
    found = []
    for part in parts:
        match = _SPEC.fullmatch(part)
        if match is None or not (match[1] or match[2]):
            return None
        if match[1]:
            begin, last = int(match[1]), int(match[2]) if match[2] else total - 1
            if match[2] and last < begin:
                return None
        else:
            begin, last = max(0, total - int(match[2])), total - 1
        if begin <= last and begin < total:
            found.append(ByteRange(begin, min(last, total - 1) + 1))
    return _merged(found)


def _merged(ranges: list[ByteRange]) -> list[ByteRange]:
    merged: list[ByteRange] = []
    for each in sorted(ranges, key=lambda r: r.begin):
        if merged and each.begin <= merged[-1].end:
            merged[-1] = ByteRange(merged[-1].begin, max(merged[-1].end, each.end))
        else:
            merged.append(each)
    return merged
