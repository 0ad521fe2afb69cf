"""The files that MaterialX documents name, for sending and watching them: textures, tiles, and other documents."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable

from ...errors import AssetError
from .documents import MOST_INCLUDES, beside, names_in
from .stand_ins import is_document

_PLACES = re.compile(r"<(UDIM|UVTILE)>|%28UDIM%29|\{(0\d+)?frame\}", re.IGNORECASE)


def files_of_documents(paths: Iterable[str]) -> tuple[set[str], set[str]]:
    """Files that the documents among these paths name, and names of files that are not there, or not there elsewhere: absolute
    ones. Of documents that cannot be read, none."""
    found: set[str] = set()
    missing: set[str] = set()
    waiting = [path for path in paths if is_document(path)]
    seen = set(waiting)
    while waiting and len(seen) <= MOST_INCLUDES:
        document = waiting.pop()
        try:
            named = names_in(document)
        except AssetError:
            continue
        for name in (*named.documents, *named.files):
            files = _files(name, document)
            found.update(files)
            if not files or os.path.isabs(name):
                missing.add(name)
        found.update(file for name in named.possible for file in _files(name, document) if os.path.exists(file))
        for path in (file for name in named.documents for file in _files(name, document)):
            if path not in seen:
                seen.add(path)
                waiting.append(path)
    return found, missing


def _files(name: str, document: str) -> list[str]:
    """On the disk; of a set of tiles, all of them."""
    if _PLACES.search(name):
        folder = os.path.dirname(document)
        pattern = "*".join(glob.escape(part) for part in _PLACES.sub("\0", os.path.join(folder, name)).split("\0"))
        return sorted(os.path.abspath(path) for path in glob.glob(pattern))
    try:
        return [os.path.abspath(beside(name, document))]
    except AssetError:
        return []
