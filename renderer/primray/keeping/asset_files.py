"""Whether files that a scene was made of are still what they were: by their size and times, as a new render would read them."""

from __future__ import annotations

import os
from collections.abc import Iterable

State = dict[str, tuple[int, ...]]


def state_of(paths: Iterable[str]) -> State | None:
    """Of files, of folders, and of packages that members of theirs are in; None where one is not there, as it may turn up
    anywhere."""
    found: State = {}
    for path in paths:
        try:
            about = os.stat(path.partition("[")[0])
        except (OSError, ValueError):
            return None
        found[path] = about.st_mtime_ns, about.st_size, about.st_ino
    return found
