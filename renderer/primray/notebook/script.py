"""One module of a module and those that it imports: widgets bring their script as a single text.

A module becomes a function that returns what it exports. Its imports and exports must each be a line of its own, as in
`import { a, b } from "./c.js";`, `export function a(` and `export const b =`.
"""

from __future__ import annotations

import re
from pathlib import Path

_IMPORT = re.compile(r'^import (\{[^}]+\}) from "([^"]+)";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|const) (\w+))", re.MULTILINE)
_DEFAULT = re.compile(r"^export default ", re.MULTILINE)
_LEFT = re.compile(r"^(?:import|export)\b.*", re.MULTILINE)


def bundled(entry: Path) -> str:
    """Return the text of the module `entry`, which has a default export, with all that it imports."""
    parts: dict[Path, str] = {}
    _add(entry.resolve(), parts)
    *imported, last = parts.values()
    return "\n".join([*imported, f"export default {last}"])


def _add(path: Path, parts: dict[Path, str]) -> None:
    text = path.read_text(encoding="utf-8")
    for found in _IMPORT.finditer(text):
        other = (path.parent / found[2]).resolve()
        if other not in parts:
            _add(other, parts)
    names = _EXPORT.findall(text)
    text = _IMPORT.sub(lambda found: f"const {found[1]} = {_name(path.parent / found[2])};", text)
    text = _EXPORT.sub("", text)
    is_entry = _DEFAULT.search(text) is not None
    text = _DEFAULT.sub("return ", text)
    if left := _LEFT.search(text):
        raise ValueError(f"{path.name}: this cannot be bundled: {left[0]}")
    given = "" if is_entry else f"return {{ {', '.join(names)} }};\n"
    function = f"(() => {{\n{text}{given}}})();\n"
    parts[path] = function if is_entry else f"const {_name(path)} = {function}"


def _name(path: Path) -> str:
    return f"{path.stem}Module"
