"""Binary layers (crates) whose values have been exchanged for values of other types, and whose names for other bytes: what no
writer of USD's makes, but a file may hold.

A crate keeps one 64-bit word a field: the value's type in bits 48 to 55, whether it is an array (63) or stands in the word
itself (62), and the value or its place below. These words and the names are blocks of LZ4, which may say everything literally.
"""

from __future__ import annotations

import struct
import tempfile
from pathlib import Path

from pxr import Sdf

_ARRAY, _INLINED = 1 << 63, 1 << 62
_ENTRY = struct.Struct("<16sqq")  # of the table of contents: name, start, size
# USD's numbers of types (crateDataTypes.h), each with a value that stands in the word itself.
TYPES = {
    "bool": 1,
    "uchar": 2,
    "int": 3,
    "int64": 5,
    "half": 7,
    "float": 8,
    "double": 9,
    "string": 10,
    "token": 11,
    "asset": 12,
    "matrix4d": 15,
    "quatf": 17,
    "float3": 24,
    "dictionary": 31,
    "token list": 32,
    "specifier": 42,
    "variability": 44,
    "block": 51,
    "timecode": 56,
}
_HALF, _FLOAT = 0x3800, 0x3F000000  # 0.5
_PAYLOADS = {"half": _HALF, "float": _FLOAT, "double": _FLOAT, "bool": 1, "uchar": 1, "int": 7, "int64": 7, "timecode": _FLOAT}
_PAYLOADS |= {"matrix4d": 0x02020202, "float3": 0x030201}  # small whole numbers: a diagonal, three components
_NEVER_INLINED = frozenset(["dictionary", "quatf", "token list"])
_EMPTY_ARRAYS = ("float", "int", "token", "float3", "asset", "string", "matrix4d", "quatf")


def words() -> dict[str, int]:
    """By the name of a type: the word of a value of it. Arrays are empty, which is of no place."""
    scalars = {n: _INLINED | (t << 48) | _PAYLOADS.get(n, 0) for n, t in TYPES.items() if n not in _NEVER_INLINED}
    return (
        scalars
        | {"dictionary": _INLINED | (TYPES["dictionary"] << 48)}
        | {f"{n}[]": _ARRAY | (TYPES[n] << 48) for n in _EMPTY_ARRAYS}
    )


class Crate:
    def __init__(self, data: bytes) -> None:
        self.data = data
        (self._toc,) = struct.unpack_from("<q", data, 16)
        (count,) = struct.unpack_from("<Q", data, self._toc)
        entries = [_ENTRY.unpack_from(data, self._toc + 8 + i * _ENTRY.size) for i in range(count)]
        self.sections = {name.rstrip(b"\0"): data[start : start + size] for name, start, size in entries}
        self._entries = entries

    @property
    def names(self) -> list[bytes]:
        _, size, packed = struct.unpack_from("<QQQ", self.sections[b"TOKENS"])
        return _unpacked(self.sections[b"TOKENS"][24 : 24 + packed], size).split(b"\0")[:-1]

    def with_names(self, names: list[bytes]) -> Crate:
        text = b"".join(name + b"\0" for name in names)
        packed = _packed(text)
        return self._with(b"TOKENS", struct.pack("<QQQ", len(names), len(text), len(packed)) + packed)

    @property
    def values(self) -> list[int]:
        """The words of all fields, each different value once."""
        section = self.sections[b"FIELDS"]
        (count,), at = struct.unpack_from("<Q", section), self._values_at()
        (size,) = struct.unpack_from("<Q", section, at)
        return list(struct.unpack(f"<{count}Q", _unpacked(section[at + 8 : at + 8 + size], 8 * count)))

    def with_values(self, values: list[int]) -> Crate:
        packed = _packed(struct.pack(f"<{len(values)}Q", *values))
        front = self.sections[b"FIELDS"][: self._values_at()]
        return self._with(b"FIELDS", front + struct.pack("<Q", len(packed)) + packed)

    @property
    def fields(self) -> list[bytes]:
        """The names of the fields, in the order of `values`: of those whose value is one, one name."""
        section = self.sections[b"FIELDS"]
        (count, size), names = struct.unpack_from("<QQ", section), self.names
        return [names[number] for number in _integers(section[16 : 16 + size], count)]

    def _values_at(self) -> int:
        (size,) = struct.unpack_from("<Q", self.sections[b"FIELDS"], 8)  # of the numbers of the fields' names
        return 16 + int(size)

    def _with(self, name: bytes, section: bytes) -> Crate:
        """The section behind everything else, and behind it another table of contents."""
        toc = struct.pack("<Q", len(self._entries))
        for known, start, size in self._entries:
            mine = known.rstrip(b"\0") == name
            toc += _ENTRY.pack(known, *((len(self.data), len(section)) if mine else (start, size)))
        data = bytearray(self.data + section)
        struct.pack_into("<q", data, 16, len(data))
        return Crate(bytes(data) + toc)


def crate_of(text: str) -> Crate:
    """Of a layer's text."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text)
    with tempfile.TemporaryDirectory() as folder:
        layer.Export(f"{folder}/a.usdc")
        return Crate(Path(folder, "a.usdc").read_bytes())


def _integers(block: bytes, count: int) -> list[int]:
    """USD's packing: the most frequent step, two bits a number on how wide its step is, and the steps that are not that one."""
    codes = (2 * count + 7) // 8
    data = _unpacked(block, None)
    (common,) = struct.unpack_from("<i", data)
    at, number, found = 4 + codes, 0, []
    for i in range(count):
        code = data[4 + i // 4] >> 2 * (i % 4) & 3
        step, at = (
            (common, at) if code == 0 else (struct.unpack_from("<" + "bhi"[code - 1], data, at)[0], at + (1, 2, 4)[code - 1])
        )
        number += step
        found.append(number)
    return found


def _unpacked(block: bytes, size: int | None) -> bytes:
    """LZ4, in one piece."""
    assert block[0] == 0
    out, at = bytearray(), 1
    while at < len(block):
        token, at = block[at], at + 1
        count, at = _length(block, at, token >> 4)
        out += block[at : at + count]
        at += count
        if at < len(block):
            back, at = block[at] | block[at + 1] << 8, at + 2
            count, at = _length(block, at, token & 15)
            for _ in range(count + 4):
                out.append(out[-back])
    assert size is None or len(out) == size
    return bytes(out)


def _length(block: bytes, at: int, first: int) -> tuple[int, int]:
    total = first
    if first == 15:
        while True:
            total, at = total + block[at], at + 1
            if block[at - 1] != 255:
                break
    return total, at


def _packed(data: bytes) -> bytes:
    """LZ4 that repeats nothing."""
    more, rest = len(data) - 15, b""
    if more >= 0:
        rest = b"\xff" * (more // 255) + bytes([more % 255])
    return bytes([0, min(len(data), 15) << 4]) + rest + data
