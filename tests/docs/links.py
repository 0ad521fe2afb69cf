"""Relative links of the Markdown pages, and whether they lead to a file and a heading that are there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Where pages lie; everything else at the top is made (.venv, build, dist, out).
FOLDERS = (".github", "contrib", "deploy", "docs", "examples", "renderer", "scenes", "service", "tests")
_LINK = re.compile(r"!?\[[^]]*\]\(([^)\s]+)\)")


def pages(root: Path = ROOT) -> list[Path]:
    return sorted([*root.glob("*.md"), *(page for folder in FOLDERS for page in (root / folder).rglob("*.md"))])


def broken_links(page: Path) -> Iterator[str]:
    """The page's relative links that lead nowhere."""
    for link in _LINK.findall(without_code(page.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, heading = link.partition("#")
        target = page.parent / path if path else page
        if not target.exists() or (heading and heading not in headings(target)):
            yield link


def headings(page: Path) -> set[str]:
    """As GitHub names a page's places: lower case, dashes for spaces, else only letters, digits, dashes and underscores."""
    if page.suffix != ".md":
        return set()
    titles = re.findall(r"^#+ (.+)$", without_code(page.read_text(encoding="utf-8"), spans=False), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-") for title in titles}


def without_code(text: str, spans: bool = True) -> str:
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]+`", "", text) if spans else text
