"""Zips written byte by byte, so that a test can say of each field what it likes; layout as in PKWARE's APPNOTE, 4.3."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

LAYER = b'#usda 1.0\n(\n    defaultPrim = "W"\n)\n\ndef Xform "W"\n{\n}\n'


@dataclass
class Entry:
    """None: as it should be. `local_*` are what the member's own header says, if it differs from the directory."""

    name: str | bytes
    data: bytes = b""
    deflate: bool = False
    flags: int = 0
    method: int | None = None
    crc: int | None = None
    size: int | None = None
    packed: bytes | None = None
    packed_size: int | None = None
    mode: int = 0o100644
    made_by: int = 3
    extra: bytes = b""
    local_name: str | bytes | None = None
    local_size: int | None = None
    local_crc: int | None = None
    local_method: int | None = None
    offset: int | None = None  # where the directory says that the header is
    align: bool = False
    body: bytes = field(default=b"", init=False)
    raw_name: bytes = field(default=b"", init=False)

    def __post_init__(self) -> None:
        if isinstance(self.name, str):
            self.flags |= 0 if self.name.isascii() else 0x800
            self.name = self.name.encode()
        self.raw_name = self.name
        self.body = self._packed() if self.packed is None else self.packed
        self.method = (8 if self.deflate else 0) if self.method is None else self.method
        self.crc = zlib.crc32(self.data) if self.crc is None else self.crc
        self.size = len(self.data) if self.size is None else self.size
        self.packed_size = len(self.body) if self.packed_size is None else self.packed_size

    def _packed(self) -> bytes:
        deflated = zlib.compressobj(6, zlib.DEFLATED, -15)
        return deflated.compress(self.data) + deflated.flush() if self.deflate else self.data


def zip_of(*entries: Entry, before: bytes = b"", after: bytes = b"", count: int | None = None) -> bytes:
    out = bytearray(before)
    directory = bytearray()
    for entry in entries:
        at = len(out) if entry.offset is None else entry.offset
        name = entry.raw_name if entry.local_name is None else entry.local_name
        raw_name = name.encode() if isinstance(name, str) else name
        extra = entry.extra
        if entry.align:
            extra += b"\0" * (-(len(out) + 30 + len(raw_name) + len(extra)) % 64)
        out += struct.pack(
            "<4sHHHHHIIIHH", b"PK\x03\x04", 20, entry.flags,
            entry.method if entry.local_method is None else entry.local_method, 0, 0x21,
            entry.crc if entry.local_crc is None else entry.local_crc, entry.packed_size,
            entry.size if entry.local_size is None else entry.local_size, len(raw_name), len(extra),
        )  # fmt: skip
        out += raw_name + extra + entry.body
        folder = 0x10 if entry.raw_name.endswith(b"/") else 0
        directory += struct.pack(
            "<4sBBHHHHHIIIHHHHHII", b"PK\x01\x02", 20, entry.made_by, 20, entry.flags, entry.method, 0, 0x21, entry.crc,
            entry.packed_size, entry.size, len(entry.raw_name), len(entry.extra), 0, 0, 0, entry.mode << 16 | folder, at,
        )  # fmt: skip
        directory += entry.raw_name + entry.extra
    start = len(out)
    out += directory
    number = len(entries) if count is None else count
    out += struct.pack("<4sHHHHIIH", b"PK\x05\x06", 0, 0, number, number, len(directory), start, 0)
    return bytes(out) + after


def package(*entries: Entry) -> bytes:
    """With a root layer in front, so that nothing else is wrong with it."""
    return zip_of(Entry("shot.usda", LAYER), *entries)
