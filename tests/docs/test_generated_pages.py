"""`make docs` writes every page that a test calls stale."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "tests/docs"


def test_make_docs_writes_every_page_that_can_be_stale() -> None:
    (rule,) = re.findall(r"^docs:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    run = set(re.findall(r"-m (tests\.docs[\w.]*)", rule))
    texts = {path: path.read_text(encoding="utf-8") for path in DOCS.rglob("*.py") if not path.name.startswith("test_")}
    writers = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path, text in texts.items()
        if '__name__ == "__main__"' in text and "write_text(" in text and path.name != "pictures.py"  # those render
    }
    assert len(writers) > 10
    assert writers == run
