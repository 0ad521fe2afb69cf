"""The glossary names places of the tree that are there, each term once, in order."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROWS = re.findall(
    r"^\| (?!Term|---)(.+?) \| (.+?) \| (.+?) \|$", (ROOT / "docs/glossary.md").read_text(encoding="utf-8"), re.MULTILINE
)


def test_places_are_there():
    places = [(term, place) for term, _, where in ROWS for place in re.findall(r"`([^`]+)`", where)]
    assert len(places) >= len(ROWS) > 30
    assert [row for row in places if not (ROOT / row[1]).exists()] == []


def test_terms_are_in_order_and_once():
    terms = [term.lower() for term, _, _ in ROWS]
    assert terms == sorted(terms)
    assert len(set(terms)) == len(terms)
