"""Git LFS pointers: the short texts that stand where a repository's large files were not fetched."""

from __future__ import annotations

_FIRST_LINE = b"version https://git-lfs.github.com/spec/v1"
WHAT_IT_IS = "it is a Git LFS pointer, not the file: run git lfs pull"


def is_pointer(content: bytes) -> bool:
    """Of a file's first bytes."""
    return content.startswith(_FIRST_LINE)


def is_pointer_file(path: str) -> bool:
    """Asked where a file could not be used; no where it cannot be read at all."""
    try:
        with open(path, "rb") as file:
            return is_pointer(file.read(len(_FIRST_LINE)))
    except (OSError, ValueError):
        return False
