"""Files that come back from a node, into the chunk's folder here: whole, or not at all."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from ..node.items import FileEnd, Part


class Received:
    """Of one chunk; `out` is its folder for a worker's files."""

    def __init__(self, out: Path) -> None:
        self._out = out

    def take(self, item: Part | FileEnd) -> None:
        """ValueError for what our tasks do not send, and for bytes that were changed on the way."""
        name = item.name
        if not name or name.startswith(".") or "/" in name or "\0" in name:
            raise ValueError(f"{name!r} is no name of a worker's file")
        partial = self._out / f".{name}.partial"
        if isinstance(item, Part):
            with open(partial, "ab") as file:
                file.write(item.data)
            return
        with open(partial, "ab+") as file:
            file.seek(0)
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        if sha256 != item.sha256:
            partial.unlink()
            raise ValueError(f"{name} has come with another content than it was sent with")
        os.replace(partial, self._out / name)
