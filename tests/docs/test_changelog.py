"""CHANGELOG.md is one that `make release` can work with and people can read."""

from __future__ import annotations

import pytest

from primray import __version__

from .changelog import CHANGELOG, faults

GOOD = """# Changelog

## Unreleased

### Added

- This.

### Fixed

- That.

## 0.2.0 (2026-11-24)

### Changed

- Another.

## 0.1.0 (2026-11-21)

### Added

- All.
"""


def test_it_has_no_fault():
    assert not list(faults(CHANGELOG.read_text(encoding="utf-8"), __version__))


@pytest.mark.parametrize("text", [GOOD, GOOD.replace("### Added\n\n- This.\n\n### Fixed\n\n- That.\n\n", "", 1)])
def test_a_good_one_has_no_fault(text):
    assert not list(faults(text, "0.2.0"))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("## Unreleased", "## Next", "'Unreleased'"),
        ("0.2.0 (2026-11-24)", "0.2.0", "'0.2.0'"),
        ("2026-11-24", "2026-11-31", "2026-11-31"),
        ("## 0.1.0", "## 0.3.0", "new to old"),
        ("## 0.2.0 (", "## 0.4.0 (", "as its newest"),
        ("### Added\n\n- This.\n\n### Fixed", "### Fixed\n\n- This.\n\n### Added", "in that order"),
        ("### Fixed", "### Mended", "in that order"),
        ("- This.", "- This,\n  and that.", "no entry of its own"),
        ("- This.", f"- {160 * 'a'}", "has an entry of 162 letters"),
        ("### Changed\n\n", "", "above its first heading"),
        ("- Another.\n", "", "nothing under Changed"),
        ("### Changed\n\n- Another.\n", "", "0.2.0 (2026-11-24): says nothing"),
    ],
)
def test_each_rule_can_fail(old, new, why):
    assert old in GOOD
    found = list(faults(GOOD.replace(old, new), "0.2.0"))
    assert any(why in fault for fault in found), found
