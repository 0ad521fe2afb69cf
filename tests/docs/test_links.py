"""Every relative link of every page leads to a file, and to a heading where it names one."""

from __future__ import annotations

import pytest

from .links import ROOT, broken_links, pages


def test_the_pages_are_found():
    found = {page.relative_to(ROOT).as_posix() for page in pages()}
    assert {"README.md", "docs/conformance.md", "docs/service/api.md", "docs/decisions/lights/slivers.md"} <= found


def test_links_lead_somewhere():
    broken = [f"{page.relative_to(ROOT)}: {link}" for page in pages() for link in broken_links(page)]
    assert not broken, "\n".join(broken)


@pytest.mark.parametrize(
    ("text", "broken"),
    [
        ("[a](other.md)", []),
        ("[a](other.md#two-words)", []),
        ("[a](#here)\n\n# Here\n", []),
        ("[a](https://example.org/x)", []),
        ("`[a](gone.md)`", []),
        ("![a](gone.png)", ["gone.png"]),
        ("[a](gone.md)", ["gone.md"]),
        ("[a](other.md#three)", ["other.md#three"]),
        ("[a](#there)\n\n# Here\n", ["#there"]),
    ],
)
def test_broken_links_are_found(tmp_path, text, broken):
    (tmp_path / "other.md").write_text("# Two words!\n", encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    assert list(broken_links(page)) == broken
