"""Answers with a file: HEAD, conditional requests, one range or several (RFC 9110, section 14).

Starlette's FileResponse is not used: it answers 400 to a Range that RFC 9110 wants ignored, 416 as soon as one of several
ranges lies outside, both as plain text, and a range to HEAD.
"""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import anyio
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from ..objects import Objects, ObjectStoreFailed
from ..problems import Problem
from .answers import check_match, none_match

PIECE_BYTES = 256 * 1024
STORED_PIECE_BYTES = 4 * 1024 * 1024  # each block is a request to the object store


@dataclass(frozen=True)
class Stored:
    """A file in an object store."""

    objects: Objects
    name: str


async def file_answer(
    request: Request,
    file: Path | Stored,
    media_type: str,
    etag: str,
    headers: Mapping[str, str],
    *,
    exactly: int | None = None,
    most_bytes: int | None = None,
) -> Response:
    """Return the answer with a file. `etag`: a strong one, in quotes. `exactly`: the size that the file must have;
    `most_bytes`: the most that is sent of a growing one. Raises Problem("not-found") if there is no file; links are not
    followed."""
    check_match(request, etag)
    common = {"etag": etag, "accept-ranges": "bytes", **headers}
    if not none_match(request, etag):
        return Response(status_code=304, headers=common)
    try:
        opened = await anyio.to_thread.run_sync(_open, file)
    except ObjectStoreFailed:
        raise
    except OSError:
        raise Problem("not-found", "The file does not exist.") from None
    total = opened.size
    if exactly not in (None, total):
        opened.close()
        raise Problem("unavailable", "The file is being replaced by another version.", headers={"retry-after": "1"})
    if most_bytes is not None:
        total = min(total, most_bytes)
    ranges = byte_ranges(request.headers.get("range"), total) if _may_use_range(request, etag) else None
    if request.method == "HEAD" or ranges == []:
        opened.close()
        if request.method == "HEAD":
            return Response(status_code=200, headers={**common, "content-length": str(total), "content-type": media_type})
        raise Problem(
            "range-not-satisfiable", f"The file has {total} bytes.", headers={"content-range": f"bytes */{total}"}, bytes=total
        )
    if ranges is None:
        whole = [(b"", ByteRange(0, total))]
        return _stream(opened, whole, b"", 200, {**common, "content-type": media_type})
    if len(ranges) == 1:
        more = {"content-type": media_type, "content-range": ranges[0].content_range(total)}
        return _stream(opened, [(b"", ranges[0])], b"", 206, {**common, **more})
    boundary = secrets.token_hex(16)
    parts = [
        (f"\r\n--{boundary}\r\nContent-Type: {media_type}\r\nContent-Range: {r.content_range(total)}\r\n\r\n".encode(), r)
        for r in ranges
    ]
    end = f"\r\n--{boundary}--\r\n".encode()
    return _stream(opened, parts, end, 206, {**common, "content-type": f"multipart/byteranges; boundary={boundary}"})


def _may_use_range(request: Request, etag: str) -> bool:
    """Return whether a Range applies: to GET, and with If-Range only for the same strong ETag (RFC 9110, 13.1.5)."""
    if_range = request.headers.get("if-range")
    return request.method == "GET" and (if_range is None or if_range.strip() == etag)


class Opened(Protocol):
    """An open file that is being sent; `piece_bytes` are read at a time."""

    size: int
    piece_bytes: int

    def read(self, size: int, at: int) -> bytes: ...

    def close(self) -> None: ...


class _Here:
    piece_bytes = PIECE_BYTES

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        self.size = os.fstat(self._handle).st_size
        self._is_open = True

    def read(self, size: int, at: int) -> bytes:
        return os.pread(self._handle, size, at)

    def close(self) -> None:
        if self._is_open:
            self._is_open = False
            os.close(self._handle)

    def __del__(self) -> None:
        self.close()


class _Stored:
    piece_bytes = STORED_PIECE_BYTES

    def __init__(self, file: Stored) -> None:
        self._file = file
        self.size = file.objects.size(file.name)

    def read(self, size: int, at: int) -> bytes:
        return self._file.objects.read(self._file.name, at, at + size)

    def close(self) -> None:
        return


def _open(file: Path | Stored) -> Opened:
    return _Stored(file) if isinstance(file, Stored) else _Here(file)


def _stream(
    opened: Opened, parts: list[tuple[bytes, ByteRange]], end: bytes, status: int, headers: Mapping[str, str]
) -> Response:
    length = sum(len(before) + part.size for before, part in parts) + len(end)
    return _FileStream(opened, parts, end, status, {**headers, "content-length": str(length)})


class _FileStream(StreamingResponse):
    """Stream that closes its file however it ends, even if it never begins to send."""

    def __init__(
        self, opened: Opened, parts: list[tuple[bytes, ByteRange]], end: bytes, status: int, headers: Mapping[str, str]
    ) -> None:
        self._opened = opened
        super().__init__(self._pieces(parts, end), status, dict(headers))

    async def _pieces(self, parts: list[tuple[bytes, ByteRange]], end: bytes) -> AsyncIterator[bytes]:
        opened = self._opened
        try:
            for before, part in parts:
                if before:
                    yield before
                at = part.begin
                while at < part.end:
                    size = min(opened.piece_bytes, part.end - at)
                    data = await anyio.to_thread.run_sync(opened.read, size, at)
                    if not data:
                        raise OSError("the file became shorter while it was sent")
                    at += len(data)
                    yield data
            if end:
                yield end
        finally:
            opened.close()


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
