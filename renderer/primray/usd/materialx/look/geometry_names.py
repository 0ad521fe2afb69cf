"""MaterialX's geometry name expressions: what they match, and their equivalents as USD paths and path expressions.

MaterialX Geometry Extensions, "Geometry Name Expressions": "*", "?" and "[]" match within a level, "{}" holds alternatives,
and "//" stands for any number of levels. A path that matches is a location, and covers everything below it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

from pxr import Sdf

_ANY = ""  # a level that matches any number of levels
_WILD = re.compile(r"[*?\[\]]")
_PATTERN = re.compile(r"([A-Za-z0-9_*?]|\[[A-Za-z0-9_]+(-[A-Za-z0-9_]+)*\])+")
_MOST_ALTERNATIVES = 256


@dataclass(frozen=True)
class GeometryName:
    """A name without alternatives, as a sequence of levels."""

    levels: tuple[str, ...]

    @cached_property
    def is_literal(self) -> bool:
        return not any(level == _ANY or _WILD.search(level) for level in self.levels)

    @cached_property
    def is_deep(self) -> bool:
        """Whether its locations have more than one depth."""
        return _ANY in self.levels

    @cached_property
    def is_everywhere(self) -> bool:
        """Whether everything that it covers is a location: names that end with any level, or with any leaf."""
        return self.levels[-1:] == (_ANY,) or self._leaves

    @property
    def depth(self) -> int:
        """Depth of its locations, the least one for a deep name."""
        return len(self.levels) - self.levels.count(_ANY)

    @property
    def _leaves(self) -> bool:
        return self.levels[-2:] == (_ANY, "*")

    def location(self, path: Sequence[str], *, is_leaf: bool = True) -> int | None:
        """Return the depth of the deepest location that covers a path, None where none does."""
        for depth in range(len(path), -1, -1):
            if self._leaves and not (is_leaf and depth == len(path)):
                continue
            if _matches(self.levels, tuple(path[:depth])):
                return depth
        return None

    def covers(self, other: GeometryName) -> bool:
        """Return whether it covers everything that a literal name covers."""
        return other.is_literal and self.location(other.levels) is not None

    def exactly(self, more: int) -> list[GeometryName]:
        """Return the names of fixed depth that together match what this one matches `more` levels below its least depth."""
        return [GeometryName(levels) for levels in _exactly(self.levels, more)]

    def at_least(self, more: int) -> list[GeometryName]:
        """Return the names that match what this one matches at least `more` levels below its least depth."""
        return [GeometryName(levels) for levels in _at_least(self.levels, more)]

    def path(self, root: Sdf.Path) -> Sdf.Path:
        """Return the path of a literal name below a root."""
        return Sdf.Path("/".join([str(root), *self.levels]))

    def expression(self, root: Sdf.Path, *, below: bool = True) -> str:
        """Return a path expression for its locations below a root, and for everything `below` them."""
        levels = self.levels[:-1] if self.levels[-1:] == (_ANY,) else self.levels
        return str(root) + "".join(f"/{level}" for level in levels) + ("//" if below else "")


def geometry_names(text: str, prefix: str = "") -> list[GeometryName]:
    """Return the names in a list of expressions, each with the prefix."""
    return [GeometryName(_levels(name)) for listed in _listed(text) for name in _alternatives(prefix + listed)]


def is_prim_name(name: GeometryName) -> bool:
    """Return whether prims can have the name, and USD's path expressions can express its wildcards."""
    return all(
        level == _ANY or (_PATTERN.fullmatch(level) if _WILD.search(level) else Sdf.Path.IsValidIdentifier(level))
        for level in name.levels
    )


def _listed(text: str) -> Iterator[str]:
    """Yield the items of a list separated by commas and spaces, except commas inside braces."""
    depth, word = 0, ""
    for character in text + ",":
        depth += (character == "{") - (character == "}")
        if depth <= 0 and (character == "," or character.isspace()):
            if word:
                yield word
            word = ""
        else:
            word += character


def _alternatives(text: str) -> list[str]:
    """Return the texts that braces expand to; a text with too many, or with unclosed braces, is unchanged."""
    waiting: list[str] = [text]
    done: list[str] = []
    while waiting and len(waiting) + len(done) <= _MOST_ALTERNATIVES:
        one = waiting.pop(0)
        found = re.search(r"\{([^{}]*)\}", one)
        if found is None:
            done.append(one)
        else:
            waiting += [one[: found.start()] + part.strip() + one[found.end() :] for part in found[1].split(",")]
    return done if not waiting else [text]


def _levels(name: str) -> tuple[str, ...]:
    """Return the levels of a name, with or without slashes at its ends."""
    parts = name.removeprefix("/").split("/")
    if parts[-1] == "":
        parts.pop()
    return tuple(part for at, part in enumerate(parts) if part or at == 0 or parts[at - 1])


@cache
def _level(pattern: str) -> re.Pattern[str]:
    parts = re.split(r"(\*|\?|\[[^\]]+\])", pattern)
    made = {"*": ".*", "?": "."}
    return re.compile("".join(made.get(p, p if p.startswith("[") and p.endswith("]") else re.escape(p)) for p in parts))


def _matches(levels: tuple[str, ...], path: tuple[str, ...]) -> bool:
    if not levels:
        return not path
    if levels[0] == _ANY:
        return any(_matches(levels[1:], path[skipped:]) for skipped in range(len(path) + 1))
    return bool(path) and _level(levels[0]).fullmatch(path[0]) is not None and _matches(levels[1:], path[1:])


def _exactly(levels: tuple[str, ...], more: int) -> Iterator[tuple[str, ...]]:
    if _ANY not in levels:
        if more == 0:
            yield levels
        return
    at = levels.index(_ANY)
    for here in range(more + 1):
        for rest in _exactly(levels[at + 1 :], more - here):
            yield (*levels[:at], *("*",) * here, *rest)


def _at_least(levels: tuple[str, ...], more: int) -> Iterator[tuple[str, ...]]:
    if more <= 0:
        yield levels
        return
    if _ANY not in levels:
        return
    at = levels.index(_ANY)
    for here in range(more):
        for rest in _at_least(levels[at + 1 :], more - here):
            yield (*levels[:at], *("*",) * here, *rest)
    yield (*levels[:at], *("*",) * more, *levels[at:])
