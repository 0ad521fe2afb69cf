"""Answers: JSON, ETags and conditional requests (RFC 9110, 8.8.3 and 13), problem documents."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from ..problems import Problem

ETAG = re.compile(r'(W/)?("[\x21\x23-\x7e\x80-\xff]*")')


def json_bytes(value: Any) -> bytes:
    """Return compact JSON; non-finite numbers become null."""
    try:
        text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(value), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.encode("utf-8", "backslashreplace")


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(member) for key, member in value.items()}
    return [_finite(member) for member in value] if isinstance(value, (list, tuple)) else value


def json_answer(value: Any, status: int = 200, headers: Mapping[str, str] | None = None) -> Response:
    return Response(
        json_bytes(value), status, {"cache-control": "private, no-cache", **(headers or {})}, media_type="application/json"
    )


def problem_answer(problem: Problem, request_id: str) -> Response:
    document = {**problem.as_json(), "request_id": request_id}
    headers = {"cache-control": "no-store", **problem.headers}
    return Response(json_bytes(document), problem.status, headers, media_type="application/problem+json")


def none_match(request: Request, etag: str) -> bool:
    """Return whether the client lacks this version: If-None-Match does not name it."""
    header = request.headers.get("if-none-match")
    return header is None or not _names(header, etag, weakly=True)


def check_match(request: Request, etag: str) -> bool:
    """Return whether If-Match was sent; raises Problem if it does not name this version."""
    header = request.headers.get("if-match")
    if header is None:
        return False
    if not _names(header, etag, weakly=False):
        raise Problem("precondition-failed", f"Its version is {etag} now.", headers={"etag": etag})
    return True


def _names(header: str, etag: str, weakly: bool) -> bool:
    if header.strip() == "*":
        return True
    return any(tag == etag and (weakly or not weak) for weak, tag in ETAG.findall(header))


def accepted(request: Request, *offered: str) -> str:
    """Return the offered media type that Accept prefers (RFC 9110, 12.5.1), the first of equals; raises Problem if none is
    accepted."""
    header = ",".join(request.headers.getlist("accept")) or "*/*"
    ranges = [_media_range(part) for part in header.split(",")]

    def quality(media_type: str) -> float:
        kind = media_type.partition("/")[0]
        matching = [(name.count("*"), q) for name, q in ranges if name in (media_type, f"{kind}/*", "*/*")]
        return min(matching, default=(0, 0.0))[1]

    best = max(offered, key=quality)
    if quality(best) <= 0:
        raise Problem("not-acceptable", f"Available: {' and '.join(offered)}.", offered=list(offered))
    return best


def _media_range(text: str) -> tuple[str, float]:
    name, *parameters = (part.strip().lower() for part in text.split(";"))
    weight = next((part[2:] for part in parameters if part.startswith("q=")), "1")
    try:
        q = float(weight)
    except ValueError:
        q = 0.0
    return name, q if 0 <= q <= 1 else 0.0


def not_modified(etag: str, headers: Mapping[str, str] | None = None) -> Response:
    return Response(status_code=304, headers={"etag": etag, "cache-control": "private, no-cache", **(headers or {})})
