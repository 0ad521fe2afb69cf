"""Files that MaterialX documents name, for packaging and for watching: textures, tiles, and other documents."""

from __future__ import annotations

import os
from collections.abc import Iterable

from ...errors import AssetError
from .documents import MOST_INCLUDES, beside, names_in
from .file_places import files_at, has_places
from .stand_ins import is_document


def files_of_documents(paths: Iterable[str]) -> tuple[set[str], set[str]]:
    """Return the files named by the documents among these paths, and names of files that exist only here or not at all.

    Names of the second kind are missing or absolute. Documents that cannot be read are skipped.
    """
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
    """Return the paths of a name that exist on disk; all tiles of a set."""
    if has_places(name):
        return files_at(os.path.join(os.path.dirname(document), name))
    try:
        return [os.path.abspath(beside(name, document))]
    except AssetError:
        return []
