"""ARCHITECTURE.md's recipes ("to add a light type, touch these files") and its tables of folders, held against the tree."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "ARCHITECTURE.md"
SOURCES = ("renderer/primray", "renderer/core", "service/primray_service")
SUFFIXES = (".py", ".hpp", ".cpp")
# By recipe, what only files name that tell its kinds apart: each file of the product that holds it is in the recipe. The kind
# that is looked for is an ordinary one, whose neighbours would be handled at the same places.
WITNESSES: Mapping[str, str] = {
    "A light type": r"\bLightType\.(CYLINDER|DISK)\b|\bLightType::k(Cylinder|Disk)\b|\b(Cylinder|Disk)Light\b",
    "A prim type": r'"HermiteCurves"|\bCurvedKindList\b',
    "A lobe of UsdPreviewSurface": r"\bkClearcoat\b|\b(b|bsdf)\.any_coat\b|\bbsdf\.p_coat\b",
    "A lobe of OpenPBR": r"\bfuzz_weight\b|\"fuzz\"|\bp_fuzz\b",
    "A diagnostic": r"^CODES\b.*=",
    "A route": r"^ROUTERS\b.*=",
    "An AOV": r'"geometric_normal"',
    "An executor": r"^EXECUTORS\b.*=",
}


@dataclass(frozen=True)
class Step:
    path: str  # with NAME in place of what is added, where the file is new
    new: bool


def recipes(text: str) -> dict[str, list[Step]]:
    """Return the files of each numbered list, by its heading; "new" marks a file that does not exist yet."""
    found = {}
    for part in re.split(r"^### ", text, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        lines = re.findall(r"^\d+\. (new )?`([^`]+)`", re.split(r"^## ", body, flags=re.MULTILINE)[0], re.MULTILINE)
        found[title.strip()] = [Step(path, bool(new)) for new, path in lines]
    return found


def recipe_faults(found: dict[str, list[Step]], root: Path = ROOT) -> Iterator[str]:
    """Yield a sentence for each recipe that is empty, names a file twice, or names one that is not there."""
    for title, steps in found.items():
        if not steps:
            yield f"{title}: names no file"
        if len({step.path for step in steps}) < len(steps):
            yield f"{title}: names a file twice"
        for step in steps:
            path = root / step.path
            if step.new and ("NAME" not in path.name or not list(path.parent.glob(f"*{path.suffix}"))):
                yield f"{title}: {step.path} is not a new NAME among others of its kind"
            if not step.new and not path.is_file():
                yield f"{title}: {step.path} is not there"


def omissions(found: dict[str, list[Step]], witnesses: Mapping[str, str] = WITNESSES, root: Path = ROOT) -> Iterator[str]:
    """Yield a sentence for each file that tells the kinds of a recipe apart and is not in it."""
    files = [
        path for folder in SOURCES for path in sorted((root / folder).rglob("*")) if path.suffix in (".py", ".hpp", ".cpp")
    ]
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    for title, witness in witnesses.items():
        named = {step.path for step in found[title]}
        beside = {str(Path(step.path).parent) for step in found[title] if step.new}  # files of the other kinds
        holders = [str(path.relative_to(root)) for path, text in texts.items() if re.search(witness, text, re.MULTILINE)]
        if not holders:
            yield f"{title}: no file has {witness}"
        yield from (
            f"{title}: {path} is not named" for path in holders if path not in named and str(Path(path).parent) not in beside
        )


def folders(text: str) -> list[str]:
    """Return the folders that the first cells of the tables name, below the folder that heads the column."""
    tables = re.findall(r"^\| `([^`]+/)` \|.*\n\|---.*\n((?:\|.*\n)+)", text, re.MULTILINE)
    return [base + name for base, rows in tables for name in re.findall(r"^\| `([^`]+/)` \|", rows, re.MULTILINE)]


def folder_faults(named: list[str], bases: tuple[str, ...], root: Path = ROOT) -> Iterator[str]:
    """Yield a sentence for each named folder that is not there, and for each folder of `bases` that is not named."""
    for name in named:
        if not (root / name).is_dir():
            yield f"{name} is not there"
    for base in bases:
        for path in sorted((root / base).iterdir()):
            if path.is_dir() and any(path.glob("*.*")) and path.name != "__pycache__" and f"{base}{path.name}/" not in named:
                yield f"{base}{path.name}/ is not named"
