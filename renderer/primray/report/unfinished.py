"""Protection of a rendered picture from failures in post-processing: the parts that succeed are still written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..diagnostics import Diagnostics

CODE = "picture-unfinished"


@contextmanager
def kept_without(what: str, diagnostics: Diagnostics) -> Iterator[None]:
    """Report any exception in the block as `what` being missing, and continue.

    Hours of samples are worth more than a clean failure. Requests that cannot be fulfilled are refused before sampling, so this
    covers the unforeseen: memory, a library, a disk.
    """
    try:
        yield
    except Exception as error:
        diagnostics.add(CODE, "", f"{what} is missing: {error or type(error).__name__}")
