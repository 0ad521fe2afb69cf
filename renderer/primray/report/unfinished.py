"""Keep a picture whose samples are there when something that is made of them fails: the rest of it is written all the same."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..diagnostics import Diagnostics

CODE = "picture-unfinished"


@contextmanager
def kept_without(what: str, diagnostics: Diagnostics) -> Iterator[None]:
    """Report whatever goes wrong in the block, after which `what` is missing, and continue.

    Any exception: hours of samples are worth more than the order in which faults are found. What is asked for and cannot be
    made is refused before sampling, so this is for what nobody foresaw: memory, a library, a disk.
    """
    try:
        yield
    except Exception as error:
        diagnostics.add(CODE, "", f"{what} is missing: {error or type(error).__name__}")
