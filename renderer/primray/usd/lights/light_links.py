"""Light linking and shadow linking: which prims lights illuminate and which cast their shadows (UsdLux LightAPI, "Linking").

Membership is USD's own answer (UsdCollectionMembershipQuery) for a prim's path; inside a native instance that is the path of
its instance proxy. Prims placed by a point instancer are queried as if the prototype were below the instancer: a rule for the
prototype's own path comes before one for the instancer's. Stages without linked lights skip all of this: `find_links` returns
None.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from pxr import Sdf, Tf, Usd

from ...description.lighting import Linked
from ...diagnostics import Diagnostics
from ..scene.context import Context
from ..scene.inheritance import Inherited, ResolvedPrim
from ..stage.messages import tf_message
from ..stage.traversal import all_prims_in_instances

LIGHT_LINK, SHADOW_LINK = "lightLink", "shadowLink"
# A light in instances has one collection per instance if it holds parts of the instance; instances beyond are not linked.
MAX_OWN = 1024
MAX_COLLECTIONS = 1 << 14
# Paths in instances for which expressions are evaluated; beyond, an instance is a member or not as a whole.
MAX_ASKED = 1 << 21
_EXPANDS = (Usd.Tokens.expandPrims, Usd.Tokens.expandPrimsAndProperties)

Handed = tuple[tuple[int, bool], ...]


@dataclass
class _Collection:
    path: str
    query: Any  # UsdCollectionMembershipQuery
    rules: dict[str, str]  # by path; empty where it is an expression
    is_expression: bool


@dataclass
class Links:
    """The distinct collections of a stage's lights, and their members; filled by `find_links`."""

    ctx: Context
    collections: list[_Collection] = field(default_factory=list)  # number 1 first
    rows: dict[bytes, int] = field(default_factory=dict)
    _numbers: dict[Any, int] = field(default_factory=dict)  # by what a collection says
    _by_light: dict[tuple[str, str], int] = field(default_factory=dict)  # by a light's path and the collection's name
    _apart: set[str] = field(default_factory=set)  # paths above lights in instances that have collections of their own
    _worn: set[int] = field(default_factory=set)  # rows that shapes have
    _ruled: dict[str, bool] = field(default_factory=dict)  # paths with rules
    _sorted: list[str] = field(default_factory=list)
    _known: dict[Any, int] = field(default_factory=dict)
    _alike: dict[Any, str] = field(default_factory=dict)  # the first of instances that are linked alike
    _inside: dict[str, list[str]] = field(default_factory=dict)  # of prototypes, the paths below
    _asked: int = 0

    def of_light(self, leaf: ResolvedPrim) -> tuple[int, int]:
        """Return the numbers of the lightLink and shadowLink collections of a prim with LightAPI; 0 for everything."""
        path = _path(leaf.prim, leaf.inherited)
        return self._by_light.get((path, LIGHT_LINK), 0), self._by_light.get((path, SHADOW_LINK), 0)

    def row_of(self, leaf: ResolvedPrim) -> int:
        """Return the row of the membership table for a shape."""
        row = self._row(_path(leaf.prim, leaf.inherited), leaf.inherited.linked_by_instancers)
        self._worn.add(row)
        return row

    def handed_to_instance(self, inherited: Inherited, instance: Usd.Prim, prototype: Usd.Prim) -> Inherited:
        """Return what a native instance hands down: the same for instances of a prototype whose prims are linked alike."""
        path, name = _path(instance, inherited), str(prototype.GetPath())
        key = (name, self._signature(path, name, inherited.linked_by_instancers))
        return replace(inherited, seen_as=self._alike.setdefault(key, path))

    def handed_to_prototype(self, inherited: Inherited, instancer: Usd.Prim, root: Usd.Prim) -> Inherited:
        """Return what a point instancer hands down to a prototype (which in most stages is below the instancer)."""
        at = _path(instancer, inherited)
        if root.IsInstanceProxy():
            inner = root.GetPrimInPrototype().GetPath()
            above = str(root.GetPath()).removesuffix(str(inner)[len(str(inner.GetPrefixes()[0])) :])
            stands, seen_as = str(root.GetPath()), above
        else:
            stands, seen_as = _path(root, inherited), inherited.seen_as if root.IsInPrototype() else ""
        if stands.startswith(f"{at}/"):
            return replace(inherited, seen_as=seen_as)
        said = dict(inherited.linked_by_instancers)
        said |= {c: answer for c in range(1, len(self.collections) + 1) if (answer := self._says(c, at)) is not None}
        return replace(inherited, seen_as=seen_as, linked_by_instancers=tuple(sorted(said.items())))

    def linked(self, diagnostics: Diagnostics) -> Linked:
        """Return the membership table; report collections without any rendered member."""
        members = np.ones((len(self.rows), 1 + len(self.collections)), np.bool_)
        for bits, row in self.rows.items():
            members[row, 1:] = np.frombuffer(bits, np.bool_)
        for collection, some in zip(self.collections, members[:, 1:].T, strict=True):
            if not any(some[row] for row in self._worn):
                light, _, name = collection.path.partition(".")
                message = f"{name} has no member that is rendered."
                diagnostics.add("link-empty", self.ctx.shown(light), message, f"{name}:includes")
        return Linked(tuple(c.path for c in self.collections), members)

    def add(self, leaf: ResolvedPrim, name: str) -> None:
        """Add a light's collection, for each of the light's instances."""
        for count, path in enumerate(_stage_paths(leaf.prim)):
            if count == MAX_OWN:
                message = f"Only the first {MAX_OWN} instances of the light have a {name}; that of the others is everything."
                self.ctx.warn("link-limited", leaf.path, message, f"collection:{name}:includes")
                return
            self._by_light[(str(path), name)] = number = self._number(path, name, leaf)
            if number and leaf.prim.IsInPrototype():
                self._apart.update(map(str, path.GetPrefixes()))

    def finish(self) -> bool:
        """Index the rules after all lights are added; return whether any light is linked."""
        for c in self.collections:
            self._ruled |= dict.fromkeys(c.rules, True)
        self._ruled.pop("/", None)
        self._sorted = sorted(self._ruled)
        self.rows[b"\1" * len(self.collections)] = 0
        return bool(self.collections)

    def _number(self, path: Sdf.Path, name: str, leaf: ResolvedPrim) -> int:
        api = Usd.CollectionAPI(self.ctx.stage.GetPrimAtPath(path), name)
        attribute = f"collection:{name}"
        try:
            query = api.ComputeMembershipQuery()
            rules = {str(p): str(rule) for p, rule in query.GetAsPathExpansionRuleMap().items()}
            is_expression = not query.UsesPathExpansionRuleMap()
            said = api.ResolveCompleteMembershipExpression().GetText() if is_expression else tuple(sorted(rules.items()))
        except Tf.ErrorException as error:
            message = f"The collection cannot be read and is ignored: {tf_message(error)}"
            self.ctx.warn("wrong-type", leaf.path, message, attribute)
            return 0
        if said == "//" or (rules.get("/") in _EXPANDS and all(rule in _EXPANDS for rule in rules.values())):
            return 0
        if said not in self._numbers:
            if len(self.collections) == MAX_COLLECTIONS:
                message = f"Only {MAX_COLLECTIONS} different collections are supported: {name} is ignored."
                self.ctx.warn("link-limited", leaf.path, message, attribute)
                return 0
            self.collections.append(_Collection(f"{path}.{attribute}", query, rules, is_expression))
            self._numbers[said] = len(self.collections)
        return self._numbers[said]

    def _row(self, path: str, handed: Handed) -> int:
        """Return the row for a path. Paths with the same nearest rule share one; expressions are evaluated for every path."""
        nearest = self._nearest(path)
        whole = any(c.is_expression for c in self.collections)
        key = (path if whole else nearest, nearest == path, handed)
        if key not in self._known:
            said = dict(handed)
            found = np.array([self._holds(c, path, said) for c in range(1, len(self.collections) + 1)], np.bool_)
            self._known[key] = self.rows.setdefault(found.tobytes(), len(self.rows))
        return self._known[key]

    def _holds(self, number: int, path: str, handed: dict[int, bool]) -> bool:
        collection = self.collections[number - 1]
        if number in handed:
            own = self._says(number, path)
            return handed[number] if own is None else own
        return bool(collection.query.IsPathIncluded(Sdf.Path(path)))

    def _says(self, number: int, path: str) -> bool | None:
        """Return a collection's own answer for a path; None if no rule applies. An expression answers only for its members."""
        collection = self.collections[number - 1]
        included = bool(collection.query.IsPathIncluded(Sdf.Path(path)))
        if collection.is_expression:
            return included or None
        return included if any(above in collection.rules for above in _prefixes(path)) else None

    def _nearest(self, path: str) -> str:
        return next((above for above in _prefixes(path) if above in self._ruled), "")

    def _signature(self, path: str, prototype: str, handed: Handed) -> tuple[Any, ...]:
        """Return a key for the links of all prims in an instance; instances with equal keys are linked alike."""
        first = bisect_left(self._sorted, f"{path}/")
        end = bisect_left(self._sorted, f"{path}0", first)  # the character after the slash
        below = [
            (ruled[len(path) :], number, c.rules[ruled])
            for ruled in self._sorted[first:end]
            for number, c in enumerate(self.collections)
            if ruled in c.rules
        ]
        expressions = [c for c in self.collections if c.is_expression]
        own = path if path in self._apart else ""
        if not expressions:
            return (self._row(f"{path}/__any_prim__", handed), *below, own)
        answers = b"".join(bytes(c.query.IsPathIncluded(p) for c in expressions) for p in self._paths_in(path, prototype))
        return (answers, *self._rule_answers(path), *below, own)

    def _rule_answers(self, path: str) -> Iterator[bool]:
        below = Sdf.Path(f"{path}/__any_prim__")
        return (bool(c.query.IsPathIncluded(below)) for c in self.collections if not c.is_expression)

    def _paths_in(self, path: str, prototype: str) -> Iterable[Sdf.Path]:
        if prototype not in self._inside:
            root = self.ctx.stage.GetPrimAtPath(prototype)
            self._inside[prototype] = [str(p.GetPath())[len(prototype) :] for p in all_prims_in_instances(root)]
        inside = self._inside[prototype]
        self._asked += len(inside)
        if self._asked > MAX_ASKED:
            message = (
                f"Expressions are evaluated for {MAX_ASKED:,} prims in instances; further instances are members as a whole."
            )
            self.ctx.warn("link-limited", "", message)
            return [Sdf.Path(path)]
        return [Sdf.Path(path + rest) for rest in inside]


def find_links(leaves: Iterable[ResolvedPrim], ctx: Context) -> Links | None:
    """Return the links of all lights found; None if no light has a collection that excludes anything."""
    if not any(_names_of(names) for names in ctx.findings.property_names):
        return None
    links = Links(ctx)
    for leaf in leaves:
        for name in _names_of(leaf.names):
            if leaf.prim.HasAPI("LightAPI"):
                links.add(leaf, name)
    return links if links.finish() else None


@lru_cache(maxsize=4096)
def _names_of(names: frozenset[str]) -> tuple[str, ...]:
    """Return which of the two collections have properties among these."""
    return tuple(name for name in (LIGHT_LINK, SHADOW_LINK) if any(n.startswith(f"collection:{name}:") for n in names))


def _path(prim: Usd.Prim, inherited: Inherited) -> str:
    """Return a prim's path in the stage; for a prim in a prototype, that of its proxy in the instance `seen_as`."""
    path = prim.GetPath()
    if not inherited.seen_as or not prim.IsInPrototype():
        return str(path)
    return inherited.seen_as + str(path)[len(str(path.GetPrefixes()[0])) :]


def _stage_paths(prim: Usd.Prim) -> Iterator[Sdf.Path]:
    """Yield a prim's path on the stage; for a prim in a prototype, the paths of its proxies in all instances."""
    if not prim.IsInPrototype():
        yield prim.GetPath()
        return
    root = prim.GetPath().GetPrefixes()[0]
    for instance in sorted(prim.GetStage().GetPrimAtPath(root).GetInstances(), key=lambda p: str(p.GetPath())):
        for path in _stage_paths(instance):
            yield prim.GetPath().ReplacePrefix(root, path)


def _prefixes(path: str) -> Iterator[str]:
    """Yield the path and its ancestors, without the root."""
    while path and path != "/":
        yield path
        path = path.rpartition("/")[0]
