"""NOTICE names every package that is installed with primray, or by an extra that its users take."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
OURS = {"publish", "site", "dev"}  # what this repository alone needs


def wanted() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    rows = [*project["dependencies"], *(row for name, rows in extras.items() if name not in OURS for row in rows)]
    return {re.split(r"[^A-Za-z0-9_.-]", row)[0].lower() for row in rows}


def named(text: str) -> set[str]:
    """The first column of the table: one name, or several with commas; what is inside a package follows a +-."""
    table = text[text.index("package        what for") : text.index("The page contains")]
    names: set[str] = set()
    for line in table.splitlines()[1:]:
        if line.startswith("  ") and line[2:3].isalnum() and not line.startswith("  with "):
            words = re.findall(r"[A-Za-z0-9_.-]+,?", line[2:])
            while words:
                word = words.pop(0)
                names.add(word.rstrip(",").lower())
                if not word.endswith(","):
                    break
    return names


def lacking(text: str) -> set[str]:
    """A family of packages is named by what their names begin with."""
    there = named(text)
    return {name for name in wanted() if name not in there and name.split("-")[0] not in there}


def test_every_package_is_named() -> None:
    assert lacking((ROOT / "NOTICE").read_text()) == set()


def test_one_that_is_not_named_is_found() -> None:
    text = (ROOT / "NOTICE").read_text()
    for name in ("MaterialX", "pyoidn", "opencolorio", "uvicorn", "s3fs"):
        assert lacking(text.replace(name, "x")) == {name.lower()}
