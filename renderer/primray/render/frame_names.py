"""Frame numbers in file names: usdrecord's ####, husk's $F4, <F4> and %04d.

Only a file's own name has such placeholders, and only where frames are requested: folders, and names derived from the stage's,
are taken literally.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ..errors import SettingsError

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
