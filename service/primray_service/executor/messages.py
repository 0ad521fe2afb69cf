"""Parser of lines from a worker, which are untrusted: bounded, parsed, and refused unless they have the shape in
worker/protocol.py."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from ..worker.protocol import MAX_LINE_BYTES, PHASES

Check = Callable[[Any], bool]
MOST_TEXT = 4096
MOST_DEPTH = 32


class BadMessage(ValueError):
    """The worker's line is not a message."""


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and abs(value) < 1e300


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


def _text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MOST_TEXT


def _object(value: Any) -> bool:
    return isinstance(value, dict)


def _list(value: Any) -> bool:
    return isinstance(value, list)


def _file(value: Any) -> bool:
    """Return whether the value is the plain name of a file in the output folder."""
    return _text(value) and 0 < len(value) <= 255 and not value.startswith(".") and not set(value) & set("/\\\0\n\r")


def _sha256(value: Any) -> bool:
    return isinstance(value, str) and len(value) == 64 and not set(value) - set("0123456789abcdef")


def _or_null(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _pair(check: Check) -> Check:
    return lambda value: isinstance(value, list) and len(value) == 2 and all(map(check, value))


def _members(**checks: Check) -> Check:
    """Return a check for an object that has at least these members."""
    return lambda value: isinstance(value, dict) and all(name in value and check(value[name]) for name, check in checks.items())


def _each(check: Check) -> Check:
    return lambda value: isinstance(value, list) and all(map(check, value))


_OUTPUT = _members(name=_file, file=_file, bytes=_count, sha256=_sha256, media_type=_text)
_ERROR = _members(metric=_text, estimate=_number, ci95=_pair(_or_null(_number)), kind=_text)
_PROBLEM = _members(type=_text, title=_text, status=_count, detail=_text)

SHAPES: Mapping[str, Check] = {
    "ready": _members(),
    "phase": _members(phase=lambda value: value in PHASES),
    "effective": _members(settings=_object, features=_list, scene=_object, resolution=_pair(_count)),
    "warning": _members(code=_text, prim=_text, detail=_text, severity=_text, kind=_text, attribute=_text),
    "progress": _members(
        fraction=lambda value: _number(value) and 0 <= value <= 1,
        samples_done=_number,
        samples_min=_count,
        samples_max=_count,
        rays=_count,
        rays_per_s=_number,
        elapsed_s=_number,
        error=_or_null(_ERROR),
        eta_s=_or_null(_number),
        eta_ci95=_or_null(_pair(_or_null(_number))),
        **{"pass": _count},
    ),
    "row": _members(t_s=_number, samples=_number, relmse=_number, ci95=_pair(_or_null(_number)), rmse=_number),
    "preview": _members(file=_file, bytes=_count, **{"pass": _count}),
    "checkpoint": _members(number=_count, file=_file, bytes=_count, samples=_number, seconds=_number),
    "facts": _members(),
    "done": _members(outputs=_each(_OUTPUT), report=_object),
    "yielded": _members(number=_count),
    "failed": _members(problem=_PROBLEM),
}


def parse(line: bytes) -> dict[str, Any]:
    """Return the message of a line; raises BadMessage if it is none."""
    if len(line) > MAX_LINE_BYTES:
        raise BadMessage(f"a line of more than {MAX_LINE_BYTES} bytes")
    try:
        message = json.loads(line, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise BadMessage("a line that is not JSON") from error
    if not isinstance(message, dict) or not isinstance(message.get("at"), str):
        raise BadMessage("a line that is not a message")
    check = SHAPES.get(message["at"])
    if check is None:
        raise BadMessage(f"an unknown message {message['at'][:40]!r}")
    if not check(message) or _depth(message) > MOST_DEPTH:
        raise BadMessage(f"a malformed message {message['at']!r}")
    return message


def _no_constant(name: str) -> float:
    raise ValueError(name)


def _depth(value: Any) -> int:
    if isinstance(value, dict):
        return 1 + max(map(_depth, value.values()), default=0)
    return 1 + max(map(_depth, value), default=0) if isinstance(value, list) else 0
