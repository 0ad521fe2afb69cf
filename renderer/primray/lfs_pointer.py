"""Git LFS pointers: the short text files that take the place of large files that were not fetched."""

from __future__ import annotations

_FIRST_LINE = b"version https://git-lfs.github.com/spec/v1"
WHAT_IT_IS = "it is a Git LFS pointer, not the file: run git lfs pull"


def is_pointer(content: bytes) -> bool:
    """Return whether a file's first bytes are those of a Git LFS pointer."""
    return content.startswith(_FIRST_LINE)


def is_pointer_file(path: str) -> bool:
    """Return whether a file that could not be used is a Git LFS pointer; False if it cannot be read at all."""
    try:
        with open(path, "rb") as file:
            return is_pointer(file.read(len(_FIRST_LINE)))
    except (OSError, ValueError):
        return False
