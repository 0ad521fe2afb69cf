"""Properties that are read from the stage on first use, and once for an object."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class ReadOnce(Generic[T]):
    """A property that is computed on first use; functools.cached_property also locks, which takes longer than a read."""

    def __init__(self, read: Callable[[Any], T]) -> None:
        self._read, self._name = read, read.__name__

    def __get__(self, record: object, owner: type[object]) -> T:
        found: T = self._read(record)
        record.__dict__[self._name] = found
        return found
