"""Texts for clients, without paths of this machine.

The renderer already names a stage's files by paths relative to its folder. All text that leaves a worker passes through here,
so that nothing else (a library's own messages, a path outside the upload) reveals paths of the machine either.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

# An absolute path between the marks that USD puts around assets: it leads outside the upload.
_OUTSIDE = re.compile(r"@/(?:[^@/]*/)*([^@/]*)@")
# USD's explanation about a file, whether it exists or not: it may quote the file's contents.
_WHY = re.compile(r" -- .*?(?=; skipping\.|\.?$)", re.DOTALL)
_PRIM = re.compile(r"(?:/[A-Za-z_]\w*)+")  # nothing but a prim's path, or a folder that could be one
_ANONYMOUS = re.compile(r"anon:0x[0-9a-fA-F]+:?")


class ClientText:
    """Texts of one worker, by its folders as it sees them."""

    def __init__(self, job: Path, out: Path, shared: Path | None = None) -> None:
        folders = [
            *([] if shared is None else [shared]),
            job / "package",
            job,
            out / "tmp",
            out,
            *map(Path, sys.path),
            Path(sys.prefix),
            Path(sys.base_prefix),
        ]
        told = {f"{place}/" for folder in folders for place in (folder, folder.resolve()) if str(folder) not in (".", "/")}
        known = "|".join(re.escape(prefix) for prefix in sorted(told, key=len, reverse=True))
        self._known = re.compile(rf"(?<![\w/.\-])(?:{known})")

    def in_text(self, text: str) -> str:
        if "/" in text and not _PRIM.fullmatch(text):
            text = self._known.sub("", text)
            if _OUTSIDE.search(text):
                text = _WHY.sub("", _OUTSIDE.sub(r"@.../\1@", text))
        return _ANONYMOUS.sub("", text) if "anon:0x" in text else text

    def in_json(self, value: Any) -> Any:
        """Return the value with all of its texts converted; prim paths stay as they are."""
        if isinstance(value, str):
            return self.in_text(value)
        if isinstance(value, Mapping):
            return {name: item if name in _PRIMS else self.in_json(item) for name, item in value.items()}
        if isinstance(value, list | tuple):
            return [self.in_json(item) for item in value]
        return value


_PRIMS = frozenset(("prim", "prim_path"))
