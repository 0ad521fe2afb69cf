"""Assignments of a look: the strongest one for a path, and ordered collection bindings for all paths.

MaterialX Geometry Extensions, "Assignment Elements": an assignment holds at its locations and below them, down to the next one
closer to the leaf; the last of those at one location wins. A look's own assignments follow those that it inherits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from .geometry_names import GeometryName, geometry_names, is_prim_name

MOST_PIECES = 1000  # parts of the assignments of one look
_TOLD_APART = 8  # depth down to which names with "//" are ranked by the depth of the path that they match


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
class Bound:
    """Shares that one assignment binds, stronger than those after it; `below`: also below their locations."""

    order: int  # index of the assignment
    below: bool
    names: tuple[GeometryName, ...]
    excludes: tuple[GeometryName, ...]

    @property
    def is_whole(self) -> bool:
        """Whether this binds everything that is not bound more strongly."""
        return self.below and not self.excludes and GeometryName(()) in self.names


def strongest(assignments: Sequence[Assignment], path: Sequence[str], *, is_leaf: bool = True) -> Assignment | None:
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


def bindings(assignments: Sequence[Assignment]) -> list[Bound]:
    """Return the bindings, strongest first: deeper names before shallower ones.

    A name with any number of levels is split into names of fixed depth. Below the depth that others have, and below
    _TOLD_APART levels where there are several such names, the last one wins, however deep.
    """
    shares = [(order, share) for order, assignment in enumerate(assignments) for share in assignment.shares]
    deep = [share.name for _, share in shares if share.name.is_deep and not share.name.is_everywhere]
    told_apart = max([share.name.depth for _, share in shares if not share.name.is_deep], default=0)
    told_apart = max(told_apart, _TOLD_APART) if len(set(deep)) > 1 else told_apart
    everywhere = any(share.name.is_everywhere for _, share in shares)
    ranked: list[tuple[tuple[float, float, int], bool, Share]] = []
    for order, share in shares:
        ranked += _ranked(order, share, told_apart, exactly=everywhere)
        if len(ranked) > MOST_PIECES:
            raise ValueError(f"its assignments have more than {MOST_PIECES:,} parts")
    ranked.sort(key=lambda item: item[0], reverse=True)
    made = []
    for (rank, below, excludes), group in groupby(ranked, key=lambda item: (item[0], item[1], item[2].excludes)):
        names = tuple(dict.fromkeys(share.name for _, _, share in group if not any(e.covers(share.name) for e in excludes)))
        if names:
            made.append(Bound(rank[2], below, names, excludes))
        if names and made[-1].is_whole:
            break
    return made


def _ranked(order: int, share: Share, told_apart: int, *, exactly: bool) -> list[tuple[tuple[float, float, int], bool, Share]]:
    """Return a share split up, each part with its rank (kind, depth, order) and whether it holds below its locations.

    Something matched at any depth is a location itself, so it ties with names that match it `exactly`.
    """
    name = share.name
    if name.is_everywhere:
        return [((2, 0, order), True, share)]
    found = [((2.0, 0.0, order), False, share)] if exactly else []
    if not name.is_deep:
        return [*found, ((0, name.depth, order), True, share)]
    for depth in range(name.depth, told_apart + 1):
        found += [((0, depth, order), True, Share(one, share.excludes)) for one in name.exactly(depth - name.depth)]
    further = name.at_least(max(told_apart + 1 - name.depth, 0))
    return [*found, *(((1, 0, order), True, Share(one, share.excludes)) for one in further)]
