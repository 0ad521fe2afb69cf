"""Reception of a scene, as a body or in a form, into a folder in incoming/: streamed, counted and hashed on the way.

Content-Length is never trusted and serves to refuse early what would be refused later. Blocking work (writing, hashing) runs
in threads, a mebibyte at a time. The parser of multipart/form-data yields parts as their bytes arrive. Digests that the
client sent (RFC 9530) are computed while the bytes pass, and compared at the end.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import errno
import hashlib
import hmac
import re
from collections.abc import AsyncIterator, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser

from ..files import DataDirectory
from ..limits import KiB, Limits, MiB
from ..problems import Problem
from .recognize import display_name, disposition_name
from .staging import to_the_end

WRITE_BYTES = 1 * MiB
FORM_OVERHEAD_BYTES = 64 * KiB  # boundaries and part headers, beside the expected fields
FILE_FIELD = "file"


@dataclass(frozen=True)
class UploadHead:
    """Head of a request, about its body; header names are found as RFC 9530 writes them and in lower case."""

    headers: Mapping[str, str]
    name: str = ""  # ?name=

    @property
    def content_type(self) -> str:
        return self.headers.get("content-type", "")

    @property
    def length(self) -> int | None:
        text = self.headers.get("content-length", "")
        return int(text) if text.isascii() and text.isdigit() else None

    @property
    def file_name(self) -> str:
        return display_name(self.name) or disposition_name(self.headers.get("content-disposition", ""))


@dataclass(frozen=True)
class Received:
    """A file that was received completely; `path` is in the given staging folder."""

    path: Path
    sha256: str
    bytes: int
    name: str
    media_type: str

    @property
    def scene_id(self) -> str:
        return f"sha256:{self.sha256}"


async def receive(
    body: AsyncIterator[bytes],
    head: UploadHead,
    staged: Path,
    data: DataDirectory,
    limits: Limits,
    fields: Collection[str] = (),
) -> tuple[Received | None, dict[str, bytes]]:
    """Return the file of a raw body, or the part `file` of a form, and the form's parts named in `fields` (each of json_bytes
    at most). A form may lack a file; a raw body must not be empty."""
    boundary = boundary_of(head.content_type)
    encoding = head.headers.get("content-encoding", "identity").lower()
    if encoding != "identity":
        raise Problem("unsupported-media-type", f"Content-Encoding {encoding!r} is not supported; send the file without one.")
    most = limits.upload_bytes
    if boundary is not None:
        most += FORM_OVERHEAD_BYTES + limits.json_bytes * len(fields)
    if head.length is not None and head.length > most:
        raise too_large(limits)
    _refuse_without_room(data, limits, head.length or 0)
    digests = BodyDigests(head.headers)
    arriving = _counted(body, digests, most, limits)
    if boundary is None:
        with _Writer(staged, data, limits) as writer:
            async for piece in arriving:
                await writer.add(piece)
            digests.check()
            received = await writer.finish(head.file_name, head.content_type)
        if not received.bytes:
            raise Problem(
                "upload-incomplete", "The body is empty; send the file's bytes as the body, or a form with a part `file`."
            )
        return received, {}
    form = await _receive_form(part_events(arriving, boundary), staged, data, limits, fields, head.name)
    digests.check()
    return form


async def _receive_form(
    events: AsyncIterator[PartBegins | bytes | None],
    staged: Path,
    data: DataDirectory,
    limits: Limits,
    fields: Collection[str],
    name: str,
) -> tuple[Received | None, dict[str, bytes]]:
    received: Received | None = None
    found: dict[str, bytes] = {}
    part = PartBegins("", "", "")
    text = bytearray()
    with _Writer(staged, data, limits) as writer:
        async for event in events:
            if isinstance(event, PartBegins):
                part = event
                text.clear()
                if part.field in found or (part.field == FILE_FIELD and received is not None):
                    raise Problem("invalid-request", f"The form has two parts named {part.field!r}.")
                if part.field != FILE_FIELD and part.field not in fields:
                    expected = ", ".join([FILE_FIELD, *fields])
                    raise Problem("invalid-request", f"The form has a part {part.field[:100]!r}; expected: {expected}.")
            elif isinstance(event, bytes) and part.field == FILE_FIELD:
                await writer.add(event)
            elif isinstance(event, bytes):
                text += event
                if len(text) > limits.json_bytes:
                    raise Problem(
                        "request-too-large",
                        f"The part {part.field!r} has more than {limits.json_bytes} bytes.",
                        limit=limits.json_bytes,
                    )
            elif part.field == FILE_FIELD:
                received = await writer.finish(display_name(name) or part.file_name, part.media_type)
                if not received.bytes:
                    raise Problem("upload-incomplete", "The form's part `file` is empty.")
            else:
                found[part.field] = bytes(text)
    return received, found


async def _counted(body: AsyncIterator[bytes], digests: BodyDigests, most: int, limits: Limits) -> AsyncIterator[bytes]:
    """Yield the body's blocks; Problem if there are too many bytes, or none for too long."""
    total = 0
    pieces = aiter(body)
    while True:
        try:
            async with asyncio.timeout(limits.upload_idle_s):
                data = await anext(pieces)
        except StopAsyncIteration:
            return
        except TimeoutError:
            raise Problem("upload-incomplete", f"Nothing arrived for {limits.upload_idle_s:g} seconds.") from None
        total += len(data)
        if total > most:
            raise too_large(limits)
        digests.update(data)
        yield data


def too_large(limits: Limits) -> Problem:
    return Problem(
        "upload-too-large",
        f"The body has more than {limits.upload_bytes} bytes.",
        headers={"Connection": "close"},
        limit=limits.upload_bytes,
    )


def _refuse_without_room(data: DataDirectory, limits: Limits, coming: int) -> None:
    if data.free_bytes() < limits.free_disk_bytes + coming:
        raise Problem("storage-full", "The server's disk has no room for this upload.", headers={"Connection": "close"})


class _Writer:
    """Writer of the staging folder's file `upload`, buffered into blocks that are worth a thread switch."""

    def __init__(self, staged: Path, data: DataDirectory, limits: Limits) -> None:
        self._path = staged / "upload"
        self._data, self._limits = data, limits
        self._buffer = bytearray()
        self._sha256 = hashlib.sha256()
        self._bytes = 0
        self._file = self._path.open("xb", buffering=0)

    def __enter__(self) -> _Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    async def add(self, data: bytes) -> None:
        self._bytes += len(data)
        if self._bytes > self._limits.upload_bytes:
            raise too_large(self._limits)
        self._buffer += data
        if len(self._buffer) >= WRITE_BYTES:
            await self._flush()

    async def finish(self, name: str, media_type: str) -> Received:
        await self._flush()
        return Received(self._path, self._sha256.hexdigest(), self._bytes, name, media_type)

    async def _flush(self) -> None:
        data, self._buffer = self._buffer, bytearray()
        await to_the_end(lambda: self._write(data))

    def _write(self, data: bytearray) -> None:
        _refuse_without_room(self._data, self._limits, len(data))
        self._sha256.update(data)
        view = memoryview(data)
        try:
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                raise Problem("storage-full", "The server's disk has no room for this upload.") from None
            raise


@dataclass(frozen=True)
class PartBegins:
    field: str
    file_name: str
    media_type: str


PART_ENDS = None
# Events: a part's beginning, its bytes, PART_ENDS.
PartEvent = PartBegins | bytes | None


def boundary_of(content_type: str) -> bytes | None:
    """Return the boundary; None unless it is a multipart form's content type."""
    if content_type.partition(";")[0].strip().lower() != "multipart/form-data":
        return None
    match = re.search(r';\s*boundary\s*=\s*(?:"([^"]{1,70})"|([^;\s"]{1,70}))', content_type, re.IGNORECASE)
    if match is None:
        raise Problem("invalid-request", "The Content-Type multipart/form-data names no boundary.")
    return (match.group(1) or match.group(2)).encode("latin-1", "replace")


async def part_events(stream: AsyncIterator[bytes], boundary: bytes) -> AsyncIterator[PartEvent]:
    """Yield events in order; Problem for a malformed or truncated body."""
    events: list[PartEvent] = []
    headers: dict[bytes, bytes] = {}
    name, value = bytearray(), bytearray()
    ended = False

    def header_end() -> None:
        headers[bytes(name).lower()] = bytes(value)
        name.clear()
        value.clear()

    def on_end() -> None:
        nonlocal ended
        ended = True

    parser = MultipartParser(
        boundary,
        {
            "on_part_begin": headers.clear,
            "on_header_field": lambda data, start, end: name.extend(data[start:end]),
            "on_header_value": lambda data, start, end: value.extend(data[start:end]),
            "on_header_end": header_end,
            "on_headers_finished": lambda: events.append(_begins(headers)),
            "on_part_data": lambda data, start, end: events.append(data[start:end]),
            "on_part_end": lambda: events.append(PART_ENDS),
            "on_end": on_end,
        },
    )
    try:
        async for data in stream:
            parser.write(data)
            for event in events:
                yield event
            events.clear()
        parser.finalize()
    except FormParserError as error:
        raise Problem("invalid-request", f"The multipart body is malformed: {error}") from None
    if not ended:
        raise Problem("upload-incomplete", "The multipart body ended before its last boundary.")


def _begins(headers: dict[bytes, bytes]) -> PartBegins:
    disposition = headers.get(b"content-disposition", b"").decode("utf-8", "replace")
    field = re.search(r'(?:^|[;\s])name\s*=\s*(?:"([^"]*)"|([^;\s]+))', disposition, re.IGNORECASE)
    if field is None:
        raise Problem("invalid-request", "A part of the multipart body has no name in its Content-Disposition.")
    media_type = headers.get(b"content-type", b"").decode("latin-1")
    return PartBegins(field.group(1) or field.group(2) or "", disposition_name(disposition), media_type)


HEADERS = ("Content-Digest", "Repr-Digest")
ALGORITHMS = {"sha-256": "sha256", "sha-512": "sha512"}  # the algorithms that RFC 9530, section 5, calls active
# A dictionary member of RFC 8941: key=:base64:; parameters are allowed and ignored.
MEMBER = re.compile(r"\s*([a-z*][a-z0-9_.*-]*)=:([A-Za-z0-9+/=]*):\s*(?:;[^,]*)?")


class BodyDigests:
    """The digests that came with a body. Algorithms other than sha-256 and sha-512 are ignored, as the RFC asks."""

    def __init__(self, headers: Mapping[str, str]) -> None:
        self._expected: list[tuple[str, str, bytes]] = []
        for header in HEADERS:
            if header in headers:
                self._expected += [(header, name, digest) for name, digest in _parse(header, headers[header])]
        self._hashes = {name: hashlib.new(ALGORITHMS[name]) for _, name, _ in self._expected}

    def update(self, data: bytes) -> None:
        for sum_ in self._hashes.values():
            sum_.update(data)

    def check(self) -> None:
        for header, name, digest in self._expected:
            computed = self._hashes[name].digest()
            if not hmac.compare_digest(computed, digest):
                raise Problem(
                    "digest-mismatch",
                    f"{header} says {name} {encoded(digest)}; what arrived has {encoded(computed)}. Send it again.",
                    header=header,
                    computed=f"{name}=:{encoded(computed)}:",
                )


def sha256_header(hexadecimal: str) -> str:
    """Return the value of Repr-Digest for a file with this SHA-256."""
    return f"sha-256=:{encoded(bytes.fromhex(hexadecimal))}:"


def encoded(digest: bytes) -> str:
    return base64.b64encode(digest).decode()


def _parse(header: str, value: str) -> list[tuple[str, bytes]]:
    found = []
    for member in value.split(","):
        match = MEMBER.fullmatch(member)
        if match is None:
            raise Problem("invalid-request", f"{header} is not in the form of RFC 9530: sha-256=:<base64>:", header=header)
        name, text = match.groups()
        if name in ALGORITHMS:
            try:
                digest = base64.b64decode(text, validate=True)
            except binascii.Error:
                digest = b""
            if len(digest) != hashlib.new(ALGORITHMS[name]).digest_size:
                raise Problem("invalid-request", f"{header}: this is not a {name} digest in base64", header=header)
            found.append((name, digest))
    return found
