"""Files that come back from a node, written into the chunk's folder here completely, or not at all."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

from ..node.items import FileEnd, Part


class Received:
    """Received files of one chunk; `out` is the folder for the worker's files."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._sha256: dict[str, Any] = {}  # running digests of incomplete files

    def take(self, item: Part | FileEnd) -> None:
        """Take a block or the end of a file; ValueError for items that our tasks do not send, and for bytes changed in
        transit."""
        name = item.name
        if not name or name.startswith(".") or "/" in name or "\0" in name:
            raise ValueError(f"{name!r} is not the name of a worker's file")
        partial = self._out / f".{name}.partial"
        if isinstance(item, Part):
            self._sha256.setdefault(name, hashlib.sha256()).update(item.data)
            with open(partial, "ab") as file:
                file.write(item.data)
            return
        sha256 = self._sha256.pop(name, hashlib.sha256()).hexdigest()
        if sha256 != item.sha256:
            partial.unlink(missing_ok=True)
            raise ValueError(f"{name} was changed in transit")
        os.replace(partial, self._out / name)
