"""Frame lists.

usdrecord's FrameSpec ("1", "1:10", "1:10x2", "1,5"), the same step after a colon ("1:10:2"), Open Job Description's ("1-10",
"1-10:2"), the ends of the stage's range by name ("start:end"), and husk's start, count and increment.
"""

from __future__ import annotations

import re
from decimal import Decimal, DecimalException, InvalidOperation

from ..errors import LimitError, SettingsError

MAX_FRAMES = 100_000
MOST = 10**9  # the largest number in a frame list

_PLAIN = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
_DASHED = re.compile(rf"({_PLAIN})\s*-\s*({_PLAIN})\s*", re.ASCII)
_DASHED_STEP = re.compile(rf"({_PLAIN}\s*-\s*{_PLAIN})\s*:\s*({_PLAIN})\s*", re.ASCII)  # Open Job Description's
_COLON_STEP = re.compile(r"([^:x]+:[^:x]+):([^:x]+)")
_ENDS = re.compile(r"(?<![a-z])(start|end)(?![a-wyz])")  # "endx2" is every other one to the end


def parse_frames(text: str) -> list[float]:
    """Return the time codes of a frame list, in its order; SettingsError if it is not valid."""
    frames: list[float] = []
    for part in text.split(","):
        frames += _parse_range(part.strip(), text)
        if len(frames) > MAX_FRAMES:
            raise LimitError(f"{len(frames)} frames are more than the {MAX_FRAMES} allowed in one command", where=text)
    return frames


def names_ends(text: str | None) -> bool:
    """Return whether a frame list names an end of the stage's range, `start` or `end`."""
    return text is not None and _ENDS.search(text) is not None


def with_ends(text: str, first: float, last: float) -> str:
    """Return the frame list with the ends of the stage's range as numbers; SettingsError if it is not valid."""
    ends = {"start": f"{Decimal(repr(first)):f}", "end": f"{Decimal(repr(last)):f}"}
    found = _ENDS.sub(lambda match: ends[match[1]].removesuffix(".0"), text)
    for part in found.split(","):
        _parse_range(part.strip(), text)
    return found


def frame_list(first: str, count: int, increment: float | None) -> str:
    """Return husk's frames as a list: `count` frames from `first`, `increment` (1) apart; SettingsError for none."""
    step = Decimal(1) if increment is None else _number(str(increment), str(increment))
    if "," in first or "x" in first or ":" in first or _DASHED.fullmatch(first):
        raise SettingsError(
            f"{first!r} is a list of frames already; a count and an increment need a single first frame", code="frames"
        )
    start = _number(first, first)
    if count < 1 or step == 0:
        raise SettingsError(
            f"{count} frames from {first}, {step} apart: the count must be above 0, and the increment not 0",
            code="frames",
        )
    if count > MAX_FRAMES:
        raise LimitError(f"{count} frames are more than the {MAX_FRAMES} allowed in one command", where=first)
    return first if count == 1 else f"{start:f}:{start + (count - 1) * step:f}x{abs(step):f}"


def _parse_range(part: str, text: str) -> list[float]:
    if match := _DASHED_STEP.fullmatch(part) or _COLON_STEP.fullmatch(part):
        part = f"{match[1]}x{match[2]}"
    span, x, stride = part.partition("x")
    span = _DASHED.sub(r"\1:\2", span) if _DASHED.fullmatch(span) else span
    first, colon, last = span.partition(":")
    start = _number(first, text)
    if not colon:
        if x:
            raise _no_frames(text)
        return [float(start)]
    stop, step = _number(last, text), abs(_number(stride, text)) if x else Decimal(1)
    if step == 0:
        raise _no_frames(text)
    try:
        steps = abs(stop - start) / step
    except DecimalException:  # beyond 10^999999: "0:1x1e-9999999"
        steps = Decimal("inf")
    if steps >= MAX_FRAMES:
        raise LimitError(f"{part} has more than the {MAX_FRAMES} frames allowed in one command", where=text)
    count = int(steps) + 1
    direction = 1 if stop >= start else -1
    return [float(start + direction * index * step) for index in range(count)]


def _number(digits: str, text: str) -> Decimal:
    try:
        value = Decimal(digits.strip())
    except InvalidOperation:
        raise _no_frames(text) from None
    if not value.is_finite():
        raise _no_frames(text)
    if value.copy_abs() > MOST:  # abs() would overflow
        sentence = f"{digits.strip()} in {text!r} is beyond {MOST:,}, the largest number in a frame list"
        raise SettingsError(f"{sentence}, and one command renders at most {MAX_FRAMES:,} frames", code="frames")
    return value


def _no_frames(text: str) -> SettingsError:
    return SettingsError(f"{text!r} is not a frame list; examples: 1, 1:10, 1:10:2, 1,5 and start:end:2", code="frames")
