"""Find the command lines that README.md and the pages of docs/ print."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
_COMMENT = re.compile(r"\s#(\s.*|$)")
_PROMPT = re.compile(r"^(?: {4}|\$ )?primray (?=[a-z])")


def pages() -> list[Path]:
    """Return README.md and the pages for users; records of decisions are history, which is not typed again."""
    docs = (path for path in (ROOT / "docs").rglob("*.md") if "decisions" not in path.parts)
    return [ROOT / "README.md", *sorted(docs)]


def printed_commands(page: Path) -> Iterator[list[str]]:
    """Yield the arguments of each line of a page's code that begins with `primray`, up to a comment, a pipe or `&`."""
    in_code = False
    text = page.read_text().replace("\\\n", " ")
    for line in text.splitlines():
        if line.startswith("```"):
            in_code = not in_code
        if _PROMPT.match(line) and (in_code or line.startswith("    ")):
            yield _arguments(line)


def _arguments(line: str) -> list[str]:
    words = shlex.split(_COMMENT.sub("", line))[1:]
    ends = [at for at, word in enumerate(words) if word in ("|", "&", ">", "&&", ";")]
    return words[: min(ends, default=len(words))]
