"""Bounded reading of a file's bytes: nothing is read, and nothing is allocated, beyond what the file holds.

Every error of the reader is a VdbError, whose message begins with the place in the file.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import numpy.typing as npt


class VdbError(ValueError):
    """An unusable OpenVDB file or grid; the message begins with the place, such as "grid 'density', leaf 12"."""


class UnsupportedVdbError(VdbError):
    """A grid that may be valid but is not read: its type, its transform or the file's version is not supported."""


_U32, _I32, _I64, _F64 = (struct.Struct(code) for code in ("<I", "<i", "<q", "<d"))


class VdbBytes:
    """A position in a file's bytes, which only moves forward and never beyond `end`; `place` names it in errors."""

    def __init__(self, data: bytes, place: str, at: int = 0, end: int | None = None) -> None:
        self.data = data
        self.place = place
        self.at = at
        self.end = len(data) if end is None else end

    def error(self, reason: str) -> VdbError:
        return VdbError(f"{self.place}: {reason}")

    def check(self, count: int, what: str) -> None:
        """Raise VdbError unless `count` more bytes exist."""
        if not 0 <= count <= self.end - self.at:
            raise self.error(f"{what} would have {count} bytes, but only {max(self.end - self.at, 0)} are left")

    def skip(self, count: int, what: str) -> None:
        self.check(count, what)
        self.at += count

    def take(self, count: int, what: str) -> bytes:
        self.check(count, what)
        self.at += count
        return self.data[self.at - count : self.at]

    def array(self, dtype: npt.DTypeLike, count: int, what: str) -> npt.NDArray[Any]:
        """Return the next `count` items as a read-only view of the bytes."""
        first = self.at
        self.skip(count * np.dtype(dtype).itemsize, what)
        return np.frombuffer(self.data, dtype, count, first)

    def byte(self, what: str) -> int:
        return self.take(1, what)[0]

    def u32(self, what: str) -> int:
        return int(_U32.unpack(self.take(4, what))[0])

    def i32(self, what: str) -> int:
        return int(_I32.unpack(self.take(4, what))[0])

    def i64(self, what: str) -> int:
        return int(_I64.unpack(self.take(8, what))[0])

    def f64(self, what: str) -> float:
        return float(_F64.unpack(self.take(8, what))[0])

    def text(self, what: str) -> str:
        return self.take(self.u32(f"the length of {what}"), what).decode(errors="replace")
