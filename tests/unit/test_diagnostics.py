"""The table of codes is complete, and nothing in it is dead."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import primray
from primray.cli.console import print_error
from primray.diagnostic_codes import CODES, Severity
from primray.diagnostics import STRICT, Diagnostics
from primray.errors import UnsupportedError

SOURCES = [p.read_text() for p in Path(primray.__file__).parent.rglob("*.py") if p.name != "diagnostic_codes.py"]
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
    found.raise_if_refused(STRICT)
    found.add("motion", "/b", "ignored")
    found.add("motion", "/b", "ignored")
    assert len(found) == 2
    assert [d.severity for d in found] == [Severity.INFO, Severity.WARNING]
    with pytest.raises(UnsupportedError, match="motion") as error:
        found.raise_if_refused(STRICT)
    assert error.value.where == "/b"


def test_strict_passes_what_leaves_the_picture_as_authored() -> None:
    found = Diagnostics()
    for code, row in CODES.items():
        if not row.kind.changes_picture:
            found.add(code, "/a", "as it should be")
    assert any(d.severity is Severity.WARNING for d in found)
    found.raise_if_refused(STRICT)


def test_a_diagnostic_as_json_says_which_attribute_and_in_which_way() -> None:
    found = Diagnostics()
    found.add("wrong-type", "/a", "inf is no number", "inputs:radius")
    [diagnostic] = found
    assert diagnostic.as_json() == {
        "severity": "warning",
        "kind": "defaulted",
        "code": "wrong-type",
        "prim_path": "/a",
        "attribute": "inputs:radius",
        "message": "inf is no number",
    }
    with pytest.raises(UnsupportedError, match=r"wrong-type: inputs:radius: inf is no number"):
        found.raise_if_refused(STRICT)


def test_one_message_about_two_attributes_is_two_diagnostics() -> None:
    found = Diagnostics()
    found.add("wrong-type", "/a", "no number", "inputs:radius")
    found.add("wrong-type", "/a", "no number", "inputs:intensity")
    found.add("wrong-type", "/a", "no number", "inputs:intensity")
    assert [d.attribute for d in found] == ["inputs:radius", "inputs:intensity"]


def test_all_that_is_refused_is_printed_before_the_error(capsys: pytest.CaptureFixture[str]) -> None:
    found = Diagnostics()
    for k in range(60):
        found.add("motion", f"/b{k}", f"ignored {k}")
        if k == 1:
            with pytest.raises(UnsupportedError) as two:
                found.raise_if_refused(STRICT)
    assert print_error(two.value, as_json=False) == 3
    lines = capsys.readouterr().err.splitlines()
    assert [line.strip() for line in lines[1:4:2]] == ["/b0", "/b1"]
    assert lines[-1].startswith("error: strict: --strict: motion: ignored 0 (and 1 more)")
    with pytest.raises(UnsupportedError) as many:
        found.raise_if_refused(STRICT)
    print_error(many.value, as_json=False)
    assert "and 80 more lines" in capsys.readouterr().err
