"""docs/diagnostics.md is what diagnostics.CODES says."""

from __future__ import annotations

from .diagnostics import BEGIN, END, PAGE, with_table

TEXT = PAGE.read_text(encoding="utf-8")


def test_the_table_is_fresh():
    assert BEGIN in TEXT
    assert END in TEXT
    assert with_table(TEXT) == TEXT, "docs/diagnostics.md is stale; run `make docs`"


def test_an_older_table_is_replaced():
    stale = f"above\n{BEGIN}\n| code |\n{END}\nbelow\n"
    made = with_table(stale)
    assert made.startswith("above\n")
    assert made.endswith("\nbelow\n")
    assert "`asset-missing`" in made
