"""Depth of nested brackets in the text of a layer, measured before USD's parser reads it.

The parser recurses, and 50,000 nested dictionaries crash the process (usd-core 26.11, a stack of 8 MB). Brackets in strings,
comments, asset paths and expressions do not count. Time is linear in the text, without recursion.
"""

from __future__ import annotations

import mmap
import os
import re
from pathlib import Path

import numpy as np

# Tokens whose brackets do not nest, longer delimiters first; an unclosed one extends to the end of its line or of the text,
# as in the parser.
_QUOTED = re.compile(
    rb'"""(?:[^\\]|\\.)*?(?:"""|\Z)' + rb"|'''(?:[^\\]|\\.)*?(?:'''|\Z)"
    rb'|"(?:[^"\\\n\r]|\\.)*+"?' + rb"|'(?:[^'\\\n\r]|\\.)*+'?"
    rb"|@@@.*?(?:@@@|\Z)|@[^@\n\r]*@?|`[^`\n\r]*`?|\#[^\n\r]*|//[^\n\r]*|/\*.*?(?:\*/|\Z)",
    re.DOTALL,
)
_OPEN, _CLOSE = b"{[(", b"}])"
_BRACKET = re.compile(rb"[][{}()]")
_LONG = 4096  # bytes between quotations above which numpy counts
_PIECE = 1 << 20
_STEP = np.zeros(256, np.int8)
_STEP[list(_OPEN)] = 1
_STEP[list(_CLOSE)] = -1


def nesting_depth(path: str | os.PathLike[str], most: int, start: int = 0, size: int | None = None) -> int:
    """Return the deepest nesting in a text file or in a stretch of one; counting ends where it is above `most`."""
    if os.path.getsize(path) == 0:
        return 0
    with (
        Path(path).open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped,
        memoryview(mapped) as whole,
        whole[start : None if size is None else start + size] as text,
    ):
        return nesting_of(text, most)


def nesting_of(text: bytes | memoryview, most: int) -> int:
    depth = deepest = at = 0
    for quoted in _QUOTED.finditer(text):
        depth, deepest = _count(text, at, quoted.start(), depth, deepest)
        at = quoted.end()
        if deepest > most:
            return deepest
    return _count(text, at, len(text), depth, deepest)[1]


def _count(text: bytes | memoryview, start: int, end: int, depth: int, deepest: int) -> tuple[int, int]:
    """Return the depth behind a stretch without quotations, and the deepest so far."""
    if end - start < _LONG:
        for bracket in _BRACKET.findall(text[start:end]):
            depth += 1 if bracket in _OPEN else -1
            deepest = max(deepest, depth)
        return depth, deepest
    for piece in range(start, end, _PIECE):
        steps = _STEP[np.frombuffer(text[piece : min(piece + _PIECE, end)], np.uint8)]
        depths = depth + np.cumsum(steps, dtype=np.int64)
        depth, deepest = int(depths[-1]), max(deepest, int(depths.max()))
    return depth, deepest
