"""Calls into the compiled core: what takes more than four things takes a structure, filled by the names of its fields."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
# Where the compiled module is called, and by what names.
FOLDERS = ("renderer/primray/core", "renderer/primray/tessellation")
CORE = ("compiled", "core", "builder", "self.builder", "self._builder")
MOST = 4


def long_calls(source: str) -> Iterator[str]:
    """Calls with more than MOST positional arguments, or with a list of them unpacked; as "line: call"."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
            continue
        if ast.unparse(node.func.value) in CORE and len(node.args) > MOST:
            yield f"{node.lineno}: {ast.unparse(node.func)}"


def long_calls_of_product() -> list[str]:
    return [
        f"{path.relative_to(ROOT)}:{call}"
        for folder in FOLDERS
        for path in sorted((ROOT / folder).rglob("*.py"))
        for call in long_calls(path.read_text(encoding="utf-8"))
    ]
