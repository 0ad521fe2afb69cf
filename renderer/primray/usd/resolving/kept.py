"""Caches of one translation, one instance per cache type."""

from __future__ import annotations

from typing import Any, TypeVar

T = TypeVar("T")


class Kept:
    """Registry of caches. Modules declare a cache type, constructible without arguments, beside the functions that use it."""

    def __init__(self) -> None:
        self._objects: dict[type[Any], Any] = {}

    def of(self, kind: type[T]) -> T:
        """Return the cache of this type, created on first use."""
        found = self._objects.get(kind)
        if found is None:
            found = self._objects[kind] = kind()
        made: T = found
        return made

    def sharing(self, *kinds: type[Any]) -> Kept:
        """Return a registry that shares the caches of these types, and has no others yet."""
        other = Kept()
        other._objects = {kind: self.of(kind) for kind in kinds}
        return other
