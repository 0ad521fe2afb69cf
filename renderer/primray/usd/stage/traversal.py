"""Traversal of a stage, in one place for all who search it (a gate holds that).

There are two policies. Prims *in the world* are those of USD's default predicate: active, loaded, defined as all their
ancestors are, not abstract. Cameras and settings are looked for there. A prim *exists* if it is active, loaded and has a
defining specifier itself, `def` or `class`, whatever its ancestors have: `class` and `over` keep prims from being drawn in
place, but relationships lead to materials and to prototypes of point instancers below them (UsdGeomPointInstancer recommends
that for prototypes).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

from pxr import Sdf, Usd

from .reads import targets, type_name

_LOADED = Usd.PrimIsActive & Usd.PrimIsLoaded
EXISTING = _LOADED & Usd.PrimHasDefiningSpecifier
IN_WORLD = EXISTING & ~Usd.PrimIsAbstract  # for children of a prim in the world
IN_PROTOTYPE = EXISTING & ~Usd.PrimHasClassSpecifier  # for children of a prim that a point instancer draws, wherever it is
EXISTING_IN_INSTANCES = Usd.TraverseInstanceProxies(EXISTING)
_LOADED_IN_INSTANCES = Usd.TraverseInstanceProxies(_LOADED)
_PROTOTYPE_IN_INSTANCES = Usd.TraverseInstanceProxies(IN_PROTOTYPE)


def world_prims(stage: Usd.Stage) -> Iterable[Usd.Prim]:
    """Return the prims in the world, outside native prototypes."""
    found: Iterable[Usd.Prim] = stage.Traverse()
    return found


def is_in_world(prim: Usd.Prim) -> bool:
    """Return whether a prim that exists is in the world, or in the drawn part of a native prototype."""
    return bool(prim.IsDefined() and not prim.IsAbstract())


def populated(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Return the active, loaded prims of a stage and of its native prototypes: those that exist, and those around them.

    Callers check `is_there` on the few prims that they use: that is cheaper than checking all.
    """
    return chain(Usd.PrimRange(stage.GetPseudoRoot(), _LOADED), *(Usd.PrimRange(p, _LOADED) for p in stage.GetPrototypes()))


def exists(prim: Usd.Prim) -> bool:
    """Return whether a populated prim has a defining specifier."""
    return bool(prim.HasDefiningSpecifier())


def find_below(root: Usd.Prim) -> Iterator[Usd.Prim]:
    """Return the prims that exist from this one down, without those in native instances."""
    return (prim for prim in Usd.PrimRange(root, _LOADED) if prim.HasDefiningSpecifier())


def all_prims(stage: Usd.Stage) -> list[Usd.Prim]:
    """Return all prims of a stage, inactive ones included, outside native prototypes: for counts and depths."""
    return list(stage.TraverseAll())


def all_prims_in_prototypes(stage: Usd.Stage) -> list[Usd.Prim]:
    return [prim for prototype in stage.GetPrototypes() for prim in Usd.PrimRange.AllPrims(prototype)]


def all_prims_in_instances(root: Usd.Prim) -> Iterable[Usd.Prim]:
    """Return all prims from this one down, those in native instances as their proxies."""
    found: Iterable[Usd.Prim] = Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate))
    return found


def range_with_instances(root: Usd.Prim) -> Usd.PrimRange:
    """Return the range of prims that exist from this one down, those in native instances as their proxies."""
    return Usd.PrimRange(root, EXISTING_IN_INSTANCES)


def collection_members(query: Usd.CollectionMembershipQuery, stage: Usd.Stage) -> frozenset[Sdf.Path]:
    """Return the paths of the prims that a collection holds, those in native instances as their proxies.

    Prims that are not in the world are included only where point instancers draw some of them.
    """
    seen = _LOADED_IN_INSTANCES if _draws_elsewhere(stage) else Usd.TraverseInstanceProxies()
    found = Usd.CollectionAPI.ComputeIncludedPaths(query, stage, seen)
    return frozenset(path.GetPrimPath() for path in found)


def drawable_prims(stage: Usd.Stage) -> list[Usd.Prim]:
    """Return all prims that may be drawn, those in native instances as proxies: the world, and prototypes of point instancers
    elsewhere."""
    found = {prim.GetPath(): prim for prim in world_prims_in_instances(stage.GetPseudoRoot())}
    waiting = list(found.values()) if _draws_elsewhere(stage) else []
    while waiting:
        instancers = [prim for prim in waiting if type_name(prim) == "PointInstancer"]
        roots = map(stage.GetPrimAtPath, dict.fromkeys(path for prim in instancers for path in _prototypes_of(prim)))
        more = {prim.GetPath(): prim for root in roots if root and root.IsActive() for prim in _below_prototype(root)}
        waiting = [prim for path, prim in more.items() if path not in found]
        found |= {prim.GetPath(): prim for prim in waiting}
    return list(found.values())


def prototypes_outside_world(stage: Usd.Stage) -> Iterator[tuple[Usd.Prim, Usd.Prim, Iterator[Usd.Prim]]]:
    """Return point instancers with each of their prototypes that is not in the world: its root, and all prims drawn below it.

    An instancer inside such a prototype comes after those that draw it.
    """
    for instancer in drawable_prims(stage) if _draws_elsewhere(stage) else []:
        for path in _prototypes_of(instancer) if type_name(instancer) == "PointInstancer" else []:
            root = stage.GetPrimAtPath(path)
            if root and root.IsActive() and not is_in_world(root):
                yield instancer, root, _below_prototype(root)


def _draws_elsewhere(stage: Usd.Stage) -> bool:
    return not all(map(is_in_world, instanced_roots(stage)))


def _below_prototype(root: Usd.Prim) -> Iterator[Usd.Prim]:
    """Return what a point instancer draws of a prototype: the root, whatever its specifier, and the prims below it."""
    yield root
    for child in root.GetFilteredChildren(_PROTOTYPE_IN_INSTANCES):
        yield from Usd.PrimRange(child, _PROTOTYPE_IN_INSTANCES)


def world_prims_in_instances(root: Usd.Prim) -> Usd.PrimRange:
    """Return the range of prims of the world from this one down, those in native instances as their proxies."""
    return Usd.PrimRange(root, Usd.TraverseInstanceProxies())


def prims_in_instances(stage: Usd.Stage, wanted: str) -> Iterator[Usd.Prim]:
    """Return prims of a type that are in the world inside native instances, as proxies, in the stage's order.

    Instances without any are skipped: there may be a great many.
    """
    holding = _prototypes_holding(stage, wanted)
    if not holding:
        return
    prims = iter(stage.Traverse(Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsInstance() and prim.GetPrototype().GetPath() not in holding:
            prims.PruneChildren()
        elif prim.IsInstanceProxy() and type_name(prim) == wanted:
            yield prim


def _prototypes_holding(stage: Usd.Stage, wanted: str) -> set[Sdf.Path]:
    """Return the native prototypes that contain such prims, directly or in nested instances."""
    holding: set[Sdf.Path] = set()
    holders: dict[Sdf.Path, set[Sdf.Path]] = {}
    for prototype in stage.GetPrototypes():
        for prim in filter(is_in_world, find_below(prototype)):
            if prim.IsInstance():
                holders.setdefault(prim.GetPrototype().GetPath(), set()).add(prototype.GetPath())
            elif type_name(prim) == wanted:
                holding.add(prototype.GetPath())
    waiting = list(holding)
    while waiting:
        above = holders.get(waiting.pop(), set()) - holding
        holding |= above
        waiting += above
    return holding


def prims_in(layer: Sdf.Layer) -> list[Sdf.Path]:
    """Return the paths of the prims that a layer has specs for, outside variants."""
    found: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, found.append)
    return [path for path in found if path.IsPrimPath()]


def specs_in(layer: Sdf.Layer) -> list[Sdf.Path]:
    """Return the paths of all specs of a layer, those in variants and targets included."""
    found: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, found.append)
    return found


def attributes_in(layer: Sdf.Layer, root: Sdf.Path) -> list[Sdf.AttributeSpec]:
    """Return the attribute specs that a layer has at a prim and below it."""
    found: list[Sdf.Path] = []
    layer.Traverse(root, found.append)
    return [attribute for attribute in map(layer.GetAttributeAtPath, found) if attribute]


def models_in(prototype: Usd.Prim) -> list[Usd.Prim]:
    """Return the models of a native prototype, whose root USD treats as a group of models."""
    return [prim for prim in Usd.PrimRange(prototype, Usd.PrimIsModel) if prim != prototype]


def children(prim: Usd.Prim, drawable_prims: Usd._PrimFlagsPredicate) -> list[Usd.Prim]:
    """Return the children that match a predicate."""
    found: list[Usd.Prim] = prim.GetFilteredChildren(drawable_prims)
    return found


def world_children(prim: Usd.Prim) -> list[Usd.Prim]:
    """Return the children that are in the world, those in native instances as their proxies."""
    return children(prim, Usd.TraverseInstanceProxies())


def all_children(prim: Usd.Prim) -> list[Usd.Prim]:
    found: list[Usd.Prim] = prim.GetAllChildren()
    return found


def instanced_roots(stage: Usd.Stage) -> list[Usd.Prim]:
    """Return the prototypes that point instancers of the world lead to, wherever they are, nested ones included."""
    met: dict[str, Usd.Prim] = {}
    waiting = [chain(world_prims(stage), *map(find_below, stage.GetPrototypes()))]
    while waiting:
        for prim in waiting.pop():
            if type_name(prim) != "PointInstancer":
                continue
            for path in _prototypes_of(prim):
                root = stage.GetPrimAtPath(path)
                if root and root.IsActive() and str(root.GetPath()) not in met:
                    met[str(root.GetPath())] = root
                    waiting.append(chain(find_below(root)))
    return list(met.values())


def _prototypes_of(instancer: Usd.Prim) -> list[str]:
    """Return the prototypes as authored; the adapter reports relationships that USD cannot follow (point_instancer)."""
    return [str(path) for path in targets(instancer, "prototypes")]
