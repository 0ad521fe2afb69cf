"""ARCHITECTURE.md's lists, "to add a light type, touch these files", and its table of folders, held against the tree."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "ARCHITECTURE.md"
# How many product files each list may have.
BUDGETS = {
    "A light type": 6,
    "A lobe": 6,
    "A prim type": 10,
    "An AOV": 5,
    "An output": 5,
    "A route": 3,
    "An executor": 2,
    "A diagnostic": 2,
}


@dataclass(frozen=True)
class Step:
    path: str  # with NAME in place of what is added, where the file is new
    new: bool


def recipes(text: str) -> dict[str, list[Step]]:
    """By heading, the files of its numbered list: each line begins with one, after "new" where it does not exist yet."""
    found = {}
    for part in re.split(r"^### ", text, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        lines = re.findall(r"^\d+\. (new )?`([^`]+)`", re.split(r"^## ", body, flags=re.MULTILINE)[0], re.MULTILINE)
        found[title.strip()] = [Step(path, bool(new)) for new, path in lines]
    return found


def recipe_faults(found: dict[str, list[Step]], root: Path = ROOT) -> Iterator[str]:
    """Sentences on lists that are missing, too long, or not true."""
    for title in found.keys() ^ BUDGETS.keys():
        yield f"{title}: {'is no list that is asked for' if title in found else 'has no list'}"
    for title, steps in found.items():
        most = BUDGETS.get(title, len(steps))
        if not 0 < len(steps) <= most:
            yield f"{title}: {len(steps)} files, {most} are allowed"
        if len({step.path for step in steps}) < len(steps):
            yield f"{title}: names a file twice"
        for step in steps:
            path = root / step.path
            if step.new and ("NAME" not in path.name or not list(path.parent.glob(f"*{path.suffix}"))):
                yield f"{title}: {step.path} is not a new NAME among others of its kind"
            if not step.new and not path.is_file():
                yield f"{title}: {step.path} is not there"


def folders(text: str) -> list[str]:
    """What the tables of rooms name: folders in backticks in first cells, below the folder that heads the column."""
    tables = re.findall(r"^\| `([^`]+/)` \|.*\n\|---.*\n((?:\|.*\n)+)", text, re.MULTILINE)
    return [base + name for base, rows in tables for name in re.findall(r"^\| `([^`]+/)` \|", rows, re.MULTILINE)]


def folder_faults(named: list[str], bases: tuple[str, ...], root: Path = ROOT) -> Iterator[str]:
    """Folders that are not there, and folders of `bases` that are not named."""
    for name in named:
        if not (root / name).is_dir():
            yield f"{name} is not there"
    for base in bases:
        for path in sorted((root / base).iterdir()):
            if path.is_dir() and any(path.glob("*.*")) and path.name != "__pycache__" and f"{base}{path.name}/" not in named:
                yield f"{base}{path.name}/ is not named"
