"""SHA-256 of what files and arrays hold: by it lock files, kept outcomes and caches tell whether anything has changed."""

from __future__ import annotations

import hashlib
import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np


def hash_of_file(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file's bytes; OSError where it cannot be read."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_of_array(values: np.ndarray[Any, Any]) -> str:
    """Return the SHA-256 of an array's type, shape and values."""
    import numpy as np

    found = hashlib.sha256(f"{values.dtype.str}{values.shape}".encode())
    found.update(np.ascontiguousarray(values).data)
    return found.hexdigest()
