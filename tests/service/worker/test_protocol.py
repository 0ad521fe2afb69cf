"""Lines from a worker: messages of the protocol's shapes are read, everything else is refused with its reason."""

from __future__ import annotations

import json
from typing import Any

import pytest

from primray_service.worker.protocol import MAX_LINE_BYTES, MOST_DEPTH, BadMessage, parse

OUTPUT = {"name": "beauty.exr", "file": "beauty.exr", "bytes": 3, "sha256": "a" * 64, "media_type": "image/x-exr"}


def line(**message: Any) -> bytes:
    return json.dumps(message).encode()


@pytest.mark.parametrize(
    "message",
    [
        {"at": "ready"},
        {"at": "phase", "phase": "sampling"},
        {"at": "checkpoint", "number": 4, "file": "c.prc", "bytes": 10, "samples": 8.0, "seconds": 1.5},
        {"at": "done", "outputs": [OUTPUT], "report": {}},
        {"at": "failed", "problem": {"type": "/problems/not-usd", "title": "t", "status": 422, "detail": "d"}},
        {"at": "yielded", "number": 1, "more": "is kept"},
    ],
)
def test_messages(message: dict[str, Any]) -> None:
    assert parse(line(**message)) == message


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"picture", "not JSON"),
        (b'{"at": NaN}', "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b'["ready"]', "not a message"),
        (b'{"at": 1}', "not a message"),
        (line(at="ended"), "unknown message 'ended'"),
        (line(at="phase", phase="sleeping"), "malformed message 'phase'"),
        (line(at="yielded", number=-1), "malformed"),
        (line(at="yielded", number=True), "malformed"),
        (line(at="done", outputs=[{**OUTPUT, "file": "../beauty.exr"}], report={}), "malformed"),
        (line(at="done", outputs=[{**OUTPUT, "sha256": "A" * 64}], report={}), "malformed"),
        (b'{"at": "ready", "more": "' + b"a" * MAX_LINE_BYTES + b'"}', "more than"),
    ],
)
def test_what_is_no_message(text: bytes, why: str) -> None:
    with pytest.raises(BadMessage, match=why):
        parse(text)


def test_nesting_is_bounded() -> None:
    nested: Any = 0
    for _ in range(MOST_DEPTH):
        nested = [nested]
    with pytest.raises(BadMessage, match="malformed"):
        parse(line(at="ready", more=nested))
