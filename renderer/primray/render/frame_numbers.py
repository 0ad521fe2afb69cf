"""Frame lists and the frame number's place in file names.

Lists are usdrecord's FrameSpec ("1", "1:10", "1:10x2", "1,5"), and "1-10" is 1:10.
"""

from __future__ import annotations

import math
import re
from decimal import Decimal, DecimalException, InvalidOperation

from ..errors import LimitError, SettingsError

MAX_FRAMES = 100_000

_PLAIN = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
_DASHED = re.compile(rf"({_PLAIN})\s*-\s*({_PLAIN})\s*", re.ASCII)

# ####, ####.## (decimals), %04d, $F4, $F, <F4>, <F>
_HOLDER = re.compile(r"(?P<hashes>#+)(?:\.(?P<decimals>#+))?|%0?(?P<percent>\d*)d|\$F(?P<dollar>\d*)|<F(?P<angle>\d*)>")


def parse_frames(text: str) -> list[float]:
    """The time codes meant, in the order given; SettingsError if it is no frame list."""
    frames: list[float] = []
    for part in text.split(","):
        frames += _parse_range(part.strip(), text)
        if len(frames) > MAX_FRAMES:
            raise LimitError(f"{len(frames)} frames are more than the {MAX_FRAMES} of one command", where=text)
    return frames


def _parse_range(part: str, text: str) -> list[float]:
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
        raise LimitError(f"{part} holds more than the {MAX_FRAMES} frames of one command", where=text)
    count = int(steps) + 1
    direction = 1 if stop >= start else -1
    return [float(start + direction * index * step) for index in range(count)]


def _number(digits: str, text: str) -> Decimal:
    try:
        value = Decimal(digits.strip())
    except InvalidOperation:
        raise _no_frames(text) from None
    if not value.is_finite() or value.copy_abs() > 10**9:  # abs() would overflow
        raise _no_frames(text)
    return value


def _no_frames(text: str) -> SettingsError:
    return SettingsError(f"{text!r} is no frame list; write one like 1, 1:10, 1-10x2 or 1,5", code="frames")


def has_frame_holder(name: str) -> bool:
    return _HOLDER.search(name) is not None


def name_of_frame(name: str, frame: float) -> str:
    """`name` with its frame holders filled in; SettingsError if one cannot hold a fractional frame."""

    def number(match: re.Match[str]) -> str:
        digits, decimals = match["hashes"], match["decimals"]
        if decimals:
            return f"{frame:0{len(digits) + 1 + len(decimals)}.{len(decimals)}f}"
        if not math.isclose(frame, round(frame), abs_tol=1e-9):
            raise SettingsError(f"frame {frame} needs a name with decimals, such as ####.##", where=name, code="frames")
        width = len(digits) if digits else int(match["percent"] or match["dollar"] or match["angle"] or 1)
        return f"{round(frame):0{width}d}"

    return _HOLDER.sub(number, name)


def check_names(names: list[str], frames: list[float] | None) -> None:
    """SettingsError unless every frame gets files of its own, under the names meant."""
    for name in names:
        if frames is None and has_frame_holder(name):
            raise SettingsError("the name holds a frame number; --frames says which", where=name, code="frames")
        if frames is not None and len(frames) > 1 and not has_frame_holder(name):
            raise SettingsError(
                f"{len(frames)} frames need a frame number in the name, such as ####", where=name, code="frames"
            )
        if frames is not None and len({name_of_frame(name, frame) for frame in frames}) < len(set(frames)):
            raise SettingsError("two frames would get the same name", where=name, code="frames")
    if len(set(names)) < len(names):
        raise SettingsError("the same output is named twice", code="frames")
