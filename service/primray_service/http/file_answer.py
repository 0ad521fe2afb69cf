"""A file as an answer: HEAD, conditional requests, one range or several.

Starlette's FileResponse is not used: it answers 400 to a Range that RFC 9110 wants ignored, 416 as soon as one of several
ranges lies outside, both as plain text, and a range to HEAD.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import AsyncIterator, Mapping
from pathlib import Path

import anyio
from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from ..problems import Problem
from .answers import check_match, none_match
from .byte_ranges import ByteRange, byte_ranges

PIECE_BYTES = 256 * 1024


async def file_answer(
    request: Request,
    path: Path,
    media_type: str,
    etag: str,
    headers: Mapping[str, str],
    *,
    exactly: int | None = None,
    most_bytes: int | None = None,
) -> Response:
    """`etag`: a strong one, in quotes. `exactly`: the file has to have so many bytes; `most_bytes`: what of a growing one is
    answered. Problem("not-found") where there is no file; links are not followed."""
    check_match(request, etag)
    common = {"etag": etag, "accept-ranges": "bytes", **headers}
    if not none_match(request, etag):
        return Response(status_code=304, headers=common)
    try:
        handle = await anyio.to_thread.run_sync(_open, path)
    except OSError:
        raise Problem("not-found", "The file is not there.") from None
    total = os.fstat(handle).st_size
    if exactly not in (None, total):
        os.close(handle)
        raise Problem("unavailable", "The file is being replaced by another version.", headers={"retry-after": "1"})
    if most_bytes is not None:
        total = min(total, most_bytes)
    ranges = byte_ranges(request.headers.get("range"), total) if _may_use_range(request, etag) else None
    if request.method == "HEAD" or ranges == []:
        os.close(handle)
        if request.method == "HEAD":
            return Response(status_code=200, headers={**common, "content-length": str(total), "content-type": media_type})
        raise Problem(
            "range-not-satisfiable", f"The file has {total} bytes.", headers={"content-range": f"bytes */{total}"}, bytes=total
        )
    if ranges is None:
        whole = [(b"", ByteRange(0, total))]
        return _stream(handle, whole, b"", 200, {**common, "content-type": media_type})
    if len(ranges) == 1:
        more = {"content-type": media_type, "content-range": ranges[0].content_range(total)}
        return _stream(handle, [(b"", ranges[0])], b"", 206, {**common, **more})
    boundary = secrets.token_hex(16)
    parts = [
        (f"\r\n--{boundary}\r\nContent-Type: {media_type}\r\nContent-Range: {r.content_range(total)}\r\n\r\n".encode(), r)
        for r in ranges
    ]
    end = f"\r\n--{boundary}--\r\n".encode()
    return _stream(handle, parts, end, 206, {**common, "content-type": f"multipart/byteranges; boundary={boundary}"})


def _may_use_range(request: Request, etag: str) -> bool:
    """Ranges are defined for GET; If-Range, only with the very same strong ETag (RFC 9110, 13.1.5)."""
    if_range = request.headers.get("if-range")
    return request.method == "GET" and (if_range is None or if_range.strip() == etag)


def _open(path: Path) -> int:
    return os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)


def _stream(handle: int, parts: list[tuple[bytes, ByteRange]], end: bytes, status: int, headers: Mapping[str, str]) -> Response:
    length = sum(len(before) + part.size for before, part in parts) + len(end)
    return _FileStream(handle, parts, end, status, {**headers, "content-length": str(length)})


class _FileStream(StreamingResponse):
    """Closes its file however it ends, even if it never begins to send."""

    def __init__(
        self, handle: int, parts: list[tuple[bytes, ByteRange]], end: bytes, status: int, headers: Mapping[str, str]
    ) -> None:
        self._file = os.fdopen(handle, "rb", buffering=0)
        super().__init__(self._pieces(parts, end), status, dict(headers))

    async def _pieces(self, parts: list[tuple[bytes, ByteRange]], end: bytes) -> AsyncIterator[bytes]:
        with self._file:
            for before, part in parts:
                if before:
                    yield before
                at = part.begin
                while at < part.end:
                    size = min(PIECE_BYTES, part.end - at)
                    data = await anyio.to_thread.run_sync(os.pread, self._file.fileno(), size, at)
                    if not data:
                        raise OSError("the file became shorter while it was sent")
                    at += len(data)
                    yield data
            if end:
                yield end
