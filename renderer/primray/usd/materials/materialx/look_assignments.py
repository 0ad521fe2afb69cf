"""Assignments of a look: the strongest one for a path, and ordered collection bindings for all paths.

MaterialX Geometry Extensions, "Assignment Elements": an assignment holds at its locations and below them, down to the next one
closer to the leaf; the last of those at one location wins. A look's own assignments follow those that it inherits.

Targets are geometry name expressions ("Geometry Name Expressions"): "*", "?" and "[]" match within a level, "{}" holds
alternatives, and "//" matches any number of levels. A path that matches is a location, and covers everything below it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import groupby
from typing import Any

from pxr import Sdf

MOST_PIECES = 1000  # parts of the assignments of one look
_MOST_RANKED_LEVELS = 8  # depth down to which names with "//" are ranked by the depth of the path that they match


@dataclass(frozen=True)
class Share:
    """Part of the target of an assignment: what a name covers, without what the excluded names cover."""

    name: GeometryName
    excludes: tuple[GeometryName, ...] = ()

    def location(self, path: Sequence[str], is_leaf: bool) -> int | None:
        """Return the depth of the deepest location that covers a path, None where none does or it is excluded."""
        if any(name.location(path, is_leaf=is_leaf) is not None for name in self.excludes):
            return None
        return self.name.location(path, is_leaf=is_leaf)


@dataclass(frozen=True)
class Assignment:
    """An assignment of `what` to these shares; a look has an ordered list of them."""

    what: Any
    shares: tuple[Share, ...]


@dataclass(frozen=True)
class LookBinding:
    """Shares that one assignment binds, stronger than those after it; `below`: also below their locations."""

    order: int  # index of the assignment
    below: bool
    names: tuple[GeometryName, ...]
    excludes: tuple[GeometryName, ...]

    @property
    def is_whole(self) -> bool:
        """Whether this binds everything that is not bound more strongly."""
        return self.below and not self.excludes and GeometryName(()) in self.names


def strongest_assignment(assignments: Sequence[Assignment], path: Sequence[str], *, is_leaf: bool = True) -> Assignment | None:
    """Return the assignment that holds for a path relative to the look's model, None where none does."""
    found: tuple[int, int] | None = None
    for order, assignment in enumerate(assignments):
        depths = [depth for share in assignment.shares if (depth := share.location(path, is_leaf)) is not None]
        if depths and (found is None or (max(depths), order) >= found):
            found = max(depths), order
    return None if found is None else assignments[found[1]]


def shares_of(element: Any, document: Any, wrong: list[str]) -> tuple[Share, ...]:
    """Return what an element's `geom` and `collection` name; `wrong` receives messages about invalid names."""
    found = [Share(name) for name in _names(element, "geom", wrong)]
    named = element.getAttribute("collection")
    return (*found, *(_of_collection(named, document, wrong, ()) if named else ()))


def _of_collection(name: str, document: Any, wrong: list[str], above: tuple[str, ...]) -> list[Share]:
    collection = document.getCollection(name)
    if collection is None or name in above:
        wrong.append(f"collection {name} includes itself" if name in above else f"there is no collection {name}")
        return []
    found = [Share(made) for made in _names(collection, "includegeom", wrong)]
    for other in collection.getAttribute("includecollection").replace(",", " ").split():
        found += _of_collection(other, document, wrong, (*above, name))
        if len(found) > MOST_PIECES:
            wrong.append(f"collection {name} has more than {MOST_PIECES:,} parts")
            return []
    excludes = tuple(_names(collection, "excludegeom", wrong))
    return [Share(share.name, (*share.excludes, *excludes)) for share in found]


def _names(element: Any, attribute: str, wrong: list[str]) -> list[GeometryName]:
    text = element.getAttribute(attribute)
    found = geometry_names(text, element.getActiveGeomPrefix()) if text else []
    for name in found:
        if not is_prim_name(name):
            wrong.append(f"{'/'.join(('', *name.levels))} is not a valid prim path ({attribute})")
    return [name for name in found if is_prim_name(name)]


def look_bindings(assignments: Sequence[Assignment]) -> list[LookBinding]:
    """Return the bindings, strongest first: deeper names before shallower ones.

    A name with any number of levels is split into names of fixed depth. Below the depth that others have, and below
    _MOST_RANKED_LEVELS where there are several such names, the last one wins, however deep.
    """
    shares = [(order, share) for order, assignment in enumerate(assignments) for share in assignment.shares]
    deep = [share.name for _, share in shares if share.name.is_deep and not share.name.is_everywhere]
    ranked_levels = max([share.name.depth for _, share in shares if not share.name.is_deep], default=0)
    ranked_levels = max(ranked_levels, _MOST_RANKED_LEVELS) if len(set(deep)) > 1 else ranked_levels
    everywhere = any(share.name.is_everywhere for _, share in shares)
    ranked: list[tuple[tuple[float, float, int], bool, Share]] = []
    for order, share in shares:
        ranked += _ranked(order, share, ranked_levels, exactly=everywhere)
        if len(ranked) > MOST_PIECES:
            raise ValueError(f"its assignments have more than {MOST_PIECES:,} parts")
    ranked.sort(key=lambda item: item[0], reverse=True)
    made = []
    for (rank, below, excludes), group in groupby(ranked, key=lambda item: (item[0], item[1], item[2].excludes)):
        names = tuple(dict.fromkeys(share.name for _, _, share in group if not any(e.covers(share.name) for e in excludes)))
        if names:
            made.append(LookBinding(rank[2], below, names, excludes))
        if names and made[-1].is_whole:
            break
    return made


def _ranked(
    order: int, share: Share, ranked_levels: int, *, exactly: bool
) -> list[tuple[tuple[float, float, int], bool, Share]]:
    """Return a share split up, each part with its rank (kind, depth, order) and whether it holds below its locations.

    Something matched at any depth is a location itself, so it ties with names that match it `exactly`.
    """
    name = share.name
    if name.is_everywhere:
        return [((2, 0, order), True, share)]
    found = [((2.0, 0.0, order), False, share)] if exactly else []
    if not name.is_deep:
        return [*found, ((0, name.depth, order), True, share)]
    for depth in range(name.depth, ranked_levels + 1):
        found += [((0, depth, order), True, Share(one, share.excludes)) for one in name.exactly(depth - name.depth)]
    further = name.at_least(max(ranked_levels + 1 - name.depth, 0))
    return [*found, *(((1, 0, order), True, Share(one, share.excludes)) for one in further)]


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
