"""Frame numbers: in file names (usdrecord's ####, husk's $F4, <F4> and %04d), and lists of them.

Frame lists are usdrecord's FrameSpec ("1", "1:10", "1:10x2", "1,5"), the same step after a colon ("1:10:2"), Open Job
Description's ("1-10", "1-10:2"), the ends of the stage's range by name ("start:end"), and husk's start, count and increment.

Only a file's own name has placeholders, and only where frames are requested: folders, and names derived from the stage's,
are taken literally.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, DecimalException, InvalidOperation
from pathlib import Path, PurePosixPath

from ..errors import LimitError, SettingsError
from ..settings.setting import LARGEST_NUMBER

# ####, ####.## (decimals), %04d, $F4, $F, <F4>, <F>; %g, $FF, <FF> write as many decimals as the number has
_HOLDER = re.compile(
    r"(?P<hashes>#+)(?:\.(?P<decimals>#+))?|(?P<free>%g|\$FF|<FF>)"
    r"|%0?(?P<percent>\d*)d|\$F(?P<dollar>\d*)|<F(?P<angle>\d*)>"
)
_PLACE_IN_SEQUENCE = re.compile(r"\$N(?![A-Za-z_])|<N\d*>")


@dataclass(frozen=True)
class FrameName:
    """A file's name for every frame: `literal` unchanged, then `pattern` with its placeholders filled in."""

    literal: str
    pattern: str

    @property
    def has_holder(self) -> bool:
        return _HOLDER.search(self.pattern) is not None

    def with_holder(self) -> FrameName:
        """Return the name with a placeholder for the number, before the extension, if it has none."""
        if self.has_holder:
            return self
        name = PurePosixPath(self.pattern)
        return FrameName(self.literal, f"{name.stem}.####{name.suffix}")

    def numbered(self, frame: float | None) -> str:
        """Return the name in a frame, with the number before the extension if the name has no placeholder.

        A name that already ends in the number, as it would be inserted, is unchanged: stages may hold a name for each frame.
        """
        if frame is None or self.has_holder:
            return self.of(frame)
        name = PurePosixPath(self.pattern)
        number = _filled("####" if _is_whole(frame) else "$FF", frame)
        ends_in_it = re.search(rf"(?:^|[._-]){re.escape(number)}$", name.stem) is not None
        return str(self) if ends_in_it else f"{self.literal}{name.stem}.{number}{name.suffix}"

    def of(self, frame: float | None) -> str:
        """Return the name in a frame (None: no frames are requested); SettingsError if a placeholder cannot hold a fraction."""
        return self.literal + (self.pattern if frame is None else _filled(self.pattern, frame))

    def __str__(self) -> str:
        return self.literal + self.pattern


def frame_name(text: str) -> FrameName:
    """Return the frame name for a path as a user typed it."""
    folder, slash, name = text.rpartition("/")
    return FrameName(folder + slash, name)


def default_name(stem: str, many: bool) -> FrameName:
    """Return the name of a picture that is called after its stage."""
    return FrameName(stem, ".####.exr" if many else ".exr")


def with_number(name: str, number: int) -> str:
    """Return a file's own name with _NUMBER appended to its stem: before the frame's placeholder, or the extension."""
    place = _HOLDER.search(name)
    end = len(name[: place.start()].rstrip("._-")) if place else 0
    end = end or len(name) - len(PurePosixPath(name).suffix)
    return f"{name[:end]}_{number}{name[end:]}"


def name_of_frame(name: str, frame: float | None) -> str:
    return frame_name(name).of(frame)


def numbered_files(name: FrameName) -> dict[float, Path]:
    """Return the existing files that match a name with a placeholder, sorted by number."""
    place = _HOLDER.search(name.pattern)
    folder = Path(name.literal or ".")
    if place is None or not folder.is_dir():
        return {}
    before, after = re.escape(name.pattern[: place.start()]), name.pattern[place.end() :]
    rest = "".join(r"[-\d.]+" if k % 2 else re.escape(part) for k, part in enumerate(_split_at_holders(after)))
    matching = re.compile(rf"{before}(-?\d+(?:\.\d+)?){rest}")
    found = {}
    for path in folder.iterdir():
        match = matching.fullmatch(path.name)
        # The pattern matches too much, such as other padding or two different numbers; only exact names count.
        if match is not None and _is_name_of(name, float(match[1]), path.name):
            found[float(match[1])] = path
    return dict(sorted(found.items()))


def _split_at_holders(text: str) -> list[str]:
    """Return the text between placeholders, and the placeholders, alternating."""
    parts, end = [], 0
    for match in _HOLDER.finditer(text):
        parts += [text[end : match.start()], match[0]]
        end = match.end()
    return [*parts, text[end:]]


def _is_name_of(name: FrameName, number: float, text: str) -> bool:
    try:
        return _filled(name.pattern, number) == text
    except SettingsError:  # a fraction where the name has no decimals
        return False


def check_names(names: Sequence[FrameName], frames: Sequence[float] | None) -> None:
    """Raise SettingsError unless every frame gets files of its own, under the names meant."""
    if frames is not None:
        for name in names:
            _check_name(name, frames)
    _check_distinct(names, frames)


def _check_distinct(names: Sequence[FrameName], frames: Sequence[float] | None) -> None:
    """Raise SettingsError if two names lead to one file, by a link or in some frame."""
    groups = [[os.path.realpath(str(name)) for name in names]]
    if len(names) > 1:
        groups += [[os.path.normpath(name.of(frame)) for name in names] for frame in frames or ()]
    for files in groups:
        for number, file in enumerate(files):
            if file in files[:number]:
                raise SettingsError("the same output is named twice", where=str(names[number]), code="output-name")


def _check_name(name: FrameName, frames: Sequence[float]) -> None:
    place = _PLACE_IN_SEQUENCE.search(name.pattern)
    if place is not None:
        sentence = f"{place[0]}, the index in the sequence, is not supported; $F, <F> and # are the frame number"
        raise SettingsError(sentence, where=str(name), code="frames")
    if len(frames) > 1 and not name.has_holder:
        sentence = f"{len(frames)} frames need a placeholder for the frame number in the file's name, such as ####"
        raise SettingsError(sentence, where=str(name), code="frames")
    if len({name.of(frame) for frame in frames}) < len(set(frames)):
        raise SettingsError("two frames would get the same name", where=str(name), code="frames")


def _is_whole(frame: float) -> bool:
    return math.isclose(frame, round(frame), abs_tol=1e-9)


def _filled(pattern: str, frame: float) -> str:
    def number(match: re.Match[str]) -> str:
        digits, decimals = match["hashes"], match["decimals"]
        if decimals:
            return f"{frame:0{len(digits) + 1 + len(decimals)}.{len(decimals)}f}"
        if match["free"]:
            return f"{frame:.15g}"
        if not _is_whole(frame):
            raise SettingsError(f"frame {frame} needs a name with decimals, such as ####.##", where=pattern, code="frames")
        width = len(digits) if digits else int(match["percent"] or match["dollar"] or match["angle"] or 1)
        return f"{round(frame):0{width}d}"

    return _HOLDER.sub(number, pattern)


MAX_FRAMES = 100_000

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
    if value.copy_abs() > LARGEST_NUMBER:  # abs() would overflow
        sentence = f"{digits.strip()} in {text!r} is beyond {LARGEST_NUMBER:,}, the largest number in a frame list"
        raise SettingsError(f"{sentence}, and one command renders at most {MAX_FRAMES:,} frames", code="frames")
    return value


def _no_frames(text: str) -> SettingsError:
    return SettingsError(f"{text!r} is not a frame list; examples: 1, 1:10, 1:10:2, 1,5 and start:end:2", code="frames")
