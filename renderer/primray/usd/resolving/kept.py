"""What is kept while one stage is translated: of each type that a module has for what it remembers, one object."""

from __future__ import annotations

from typing import Any, TypeVar

T = TypeVar("T")


class Kept:
    """Modules declare what they keep beside the functions that use it, as a type that is made without arguments."""

    def __init__(self) -> None:
        self._objects: dict[type[Any], Any] = {}

    def of(self, kind: type[T]) -> T:
        """The one object of this type, made when it is first asked for."""
        found = self._objects.get(kind)
        if found is None:
            found = self._objects[kind] = kind()
        made: T = found
        return made

    def sharing(self, *kinds: type[Any]) -> Kept:
        """Another that has these of it, and nothing else yet."""
        other = Kept()
        other._objects = {kind: self.of(kind) for kind in kinds}
        return other
