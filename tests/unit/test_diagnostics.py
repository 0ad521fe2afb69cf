"""The table of codes is complete, and nothing in it is dead."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import primray
from primray.diagnostics import CODES, Diagnostics, Severity
from primray.errors import UnsupportedError

SOURCES = [p.read_text() for p in Path(primray.__file__).parent.rglob("*.py") if p.name != "diagnostics.py"]
USED = {m for text in SOURCES for m in re.findall(r'(?:\.warn|diagnostics\.add|shown\.add)\(\s*"([a-z-]+)"', text)}


def test_every_code_is_listed_and_every_listed_code_is_used() -> None:
    assert set(CODES) >= USED
    assert {code for code in CODES if not any(f'"{code}"' in text for text in SOURCES)} == set()
    for code, row in CODES.items():
        assert re.fullmatch(r"[a-z]+(-[a-z]+)*", code)
        assert row.meaning.endswith(".")


def test_strict_passes_information_only() -> None:
    found = Diagnostics()
    found.add("tessellated", "/a", "as a mesh")
    found.raise_if_strict()
    found.add("motion", "/b", "ignored")
    found.add("motion", "/b", "ignored")
    assert len(found) == 2
    assert [d.severity for d in found] == [Severity.INFO, Severity.WARNING]
    with pytest.raises(UnsupportedError, match="motion") as error:
        found.raise_if_strict()
    assert error.value.where == "/b"
