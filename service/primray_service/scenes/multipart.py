"""Parser of multipart/form-data bodies that yields parts as their bytes arrive: nothing is collected in memory or on disk."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from dataclasses import dataclass

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser

from ..problems import Problem
from .recognize import disposition_name


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
