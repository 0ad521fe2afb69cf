"""Comments and docstrings name only files that there are."""

from __future__ import annotations

import ast
import io
import os
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"(?<![\w<.-])((?:[\w.-]+/)*\w+\.(?:py|hpp))\b")
SPECIAL = {"sitecustomize.py"}  # of Python


def tracked() -> list[str]:
    return subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()


def prose(name: str, text: str) -> Iterator[str]:
    """The comments of a source file, and a Python file's docstrings."""
    if not name.endswith(".py"):
        yield from re.findall(r"//(.*)", text)
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.string
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield ast.get_docstring(node) or ""


def ends_of(files: list[str]) -> set[str]:
    """Return the files as a comment may name them: from any of their folders on."""
    return {file[at:] for file in files for at in [0, *(m.end() for m in re.finditer("/", file))]}


def lost(name: str, text: str, ends: set[str]) -> list[str]:
    """Return the files that the text names and that are not there; a name without a folder may be of any."""
    if not NAMED.search(text):
        return []  # without being parsed, as most are
    found = (match for each in prose(name, text) for match in NAMED.findall(each))
    return [match for match in found if match.lstrip("./") not in ends and os.path.basename(match) not in SPECIAL]


def test_named_files_are_there() -> None:
    files = tracked()
    sources = [each for each in files if each.endswith((".py", ".hpp", ".cpp")) and not each.startswith("tests/")]
    ends = ends_of(files)
    assert len(sources) > 500
    assert {name: names for name in sources if (names := lost(name, (ROOT / name).read_text(), ends))} == {}


def test_a_lost_one_is_found() -> None:
    ends = ends_of(["renderer/primray/usd/stage/open.py", "renderer/core/math/lanes.hpp"])
    text = '"""Opened by stage/open.py, not by usd/stage.py."""\nx = "none.py"  # as in lanes.hpp and lane.hpp\n'
    assert sorted(lost("a.py", text, ends)) == ["lane.hpp", "usd/stage.py"]
    assert lost("a.hpp", "// math/lanes.hpp, light/lanes.hpp\n#include <none.hpp>\n", ends) == ["light/lanes.hpp"]
