"""Return of unused memory to the system before acceleration structures are built, when a render's memory peaks.

The C library keeps what translation freed, and USD's libraries and files stay mapped; their pages are read again from the file
cache if they are needed. Linux with glibc only; a no-op elsewhere.
"""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Iterator

WORTH_ITEMS = 200_000  # triangles and instances; smaller scenes are not worth the time that reading the mappings takes
_DONTNEED = getattr(mmap, "MADV_DONTNEED", None)


def give_back() -> None:
    """Release free pages of the heap and clean pages of mapped files."""
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "malloc_trim") or _DONTNEED is None:
        return
    libc.malloc_trim(0)
    libc.madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    for start, size in _clean_file_pages():
        libc.madvise(start, size, _DONTNEED)


def _clean_file_pages() -> Iterator[tuple[int, int]]:
    """Return start and size of mapped files (libraries, USD files) that were never written to.

    Written pages ("Anonymous" in smaps) exist in no file.
    """
    try:
        with open("/proc/self/smaps", encoding="utf-8", errors="replace") as file:
            lines = file.readlines()
    except OSError:
        return
    start = size = 0
    for line in lines:
        if line.startswith("Anonymous:"):
            if size and line.split()[1] == "0":
                yield start, size
            size = 0
        elif not line[0].isupper():  # first line of a mapping: range, rights, offset, device, inode, name
            ends, rights, *rest = line.split(maxsplit=5)
            start, end = (int(end, 16) for end in ends.split("-"))
            is_file = len(rest) == 4 and rest[3].startswith("/") and rights in ("r--p", "r-xp")
            size = end - start if is_file else 0
