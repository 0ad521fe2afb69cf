"""File names of products within a job: plain ASCII names without folders, distinct between products."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from pathlib import PurePosixPath

from primray.errors import SettingsError
from primray.render.frames import frame_name

LONGEST = 60  # characters of a stem, which the frame's suffix follows, and a number if two are equal


def names_within_job(files: Sequence[str], time_code: float | None, end: str) -> list[str]:
    """Return a name for each product's file of a frame, from the paths in productName.

    Folders are dropped, unless two files differ in them alone. `end` comes before the extension; if a name has its own
    placeholder for the frame's number, the number is not repeated. SettingsError if there is such a placeholder and no frame.
    """
    own = [_at_frame(file, time_code) for file in files]
    plain = [PurePosixPath(file).name.casefold() for file in own]
    names: list[str] = []
    for file, name in zip(own, plain, strict=True):
        path = PurePosixPath(file)
        parts = path.parts if plain.count(name) > 1 else (path.name,)
        stem = _stem("_".join((*parts[:-1], path.stem)), end)
        names.append(_distinct(stem, f"{end}{path.suffix.lower()}", names))
    return names


def _at_frame(file: str, time_code: float | None) -> str:
    name = frame_name(file)
    if time_code is None and name.has_holder:
        sentence = "The product's name has a placeholder for the frame's number: give the frames to render in settings.frames"
        raise SettingsError(sentence, where=file, code="frames")
    return name.of(time_code)


def _stem(text: str, end: str) -> str:
    """Return the text as letters, digits, _, - and single dots, beginning with a letter or digit and without the frame's
    number."""
    number = end.partition(".")[2]
    if number and re.search(rf"(^|[._-]){re.escape(number)}$", text):
        text = text[: -len(number)].rstrip("._-")
    text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    text = re.sub(r"\.{2,}", ".", re.sub(r"[^A-Za-z0-9_.-]+", "_", text))
    return text.lstrip("._-")[:LONGEST].rstrip("._-") or "picture"


def _distinct(stem: str, rest: str, taken: Sequence[str]) -> str:
    known, name, number = {each.casefold() for each in taken}, stem + rest, 2
    while name.casefold() in known:
        name, number = f"{stem}_{number}{rest}", number + 1
    return name
