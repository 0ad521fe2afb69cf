"""What CHANGELOG.md must look like: versions from new to old, each with entries under the same few headings."""

from __future__ import annotations

import datetime
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

from packaging.version import Version

CHANGELOG = Path(__file__).resolve().parents[2] / "CHANGELOG.md"
HEADINGS = ("Breaking", "Added", "Changed", "Faster", "Fixed", "Removed")


MOST_LETTERS = 160  # of an entry: what is longer belongs to a page that the entry links


def faults(text: str, version: str) -> Iterator[str]:
    """Sentences on what is wrong with it, where `version` is that of the package."""
    _, *parts = re.split(r"^## ", text, flags=re.MULTILINE)
    titles = [part.partition("\n")[0] for part in parts]
    if titles[:1] != ["Unreleased"]:
        yield "does not begin with the section 'Unreleased'"
    released = [re.fullmatch(r"(\d+\.\d+\.\d+(?:rc\d+)?) \((.+)\)", title) for title in titles[1:]]
    for title, found in zip(titles[1:], released, strict=True):
        if not found or not _is_date(found[2]):
            yield f"has a section {title!r}, not 'x.y.z (year-month-day)'"
    numbers = [Version(found[1]) for found in released if found]
    if any(later <= earlier for later, earlier in itertools.pairwise(numbers)):
        yield "has versions that do not go from new to old"
    if numbers[:1] != [Version(version)]:
        yield f"does not have {version}, the package's version, as its newest"
    for title, part in zip(titles, parts, strict=True):
        yield from (f"{title}: {why}" for why in _section_faults(part, is_unreleased=title == "Unreleased"))


def _section_faults(part: str, is_unreleased: bool) -> Iterator[str]:
    before, *groups = re.split(r"^### ", part.partition("\n")[2], flags=re.MULTILINE)
    names = [group.partition("\n")[0] for group in groups]
    if "\n- " in f"\n{before}":
        yield "has entries above its first heading"
    if names != [heading for heading in HEADINGS if heading in names]:
        yield f"has the headings {', '.join(names)}, not some of {', '.join(HEADINGS)} in that order"
    yield from (f"has nothing under {name}" for name, group in zip(names, groups, strict=True) if "\n- " not in group)
    if is_unreleased:  # entries of released versions stay as they were published
        lines = [line for group in groups for line in group.splitlines()[1:] if line]
        yield from (f"has a line that is no entry of its own: {line}" for line in lines if not line.startswith("- "))
        yield from (f"has an entry of {len(line)} letters: {line}" for line in lines if len(line) > MOST_LETTERS)
    if not groups and not is_unreleased:
        yield "says nothing"


def _is_date(text: str) -> bool:
    try:
        datetime.date.fromisoformat(text)
    except ValueError:
        return False
    return True
