"""State of the files that a scene was made from, by size and times: tells whether a new render would read the same."""

from __future__ import annotations

import os
from collections.abc import Iterable

State = dict[str, tuple[int, ...]]


def state_of(paths: Iterable[str]) -> State | None:
    """Return the state of files and folders, for members of packages that of the package; None where one does not exist."""
    found: State = {}
    for path in paths:
        try:
            about = os.stat(path.partition("[")[0])
        except (OSError, ValueError):
            return None
        found[path] = about.st_mtime_ns, about.st_size, about.st_ino
    return found
