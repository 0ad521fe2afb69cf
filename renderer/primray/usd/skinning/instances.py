"""Native instances that skeletons affect: baking does not reach into instances, so they are made uninstanced on a stage copy.

If there are too many, instances with the same pose form a crowd: one of them is posed, and a class in the session layer gives
its pose to all others, which remain instances.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, count

from pxr import Sdf, Usd, UsdGeom

from ...diagnostics import Diagnostics
from ..scene.inheritance import transforms, world_matrix
from ..stage.edits import OpinionsLeak, composers, end_instance
from ..stage.reads import FAILURES, property_names, targets, type_name
from ..stage.traversal import all_prims_in_instances, find_below, instanced_roots, is_in_world, world_prims
from ..stage.values import When, read
from .bindings import bindings_below, copy_marks, prims_of_binding

_BINDING = ("skel:", "primvars:skel:")


@dataclass
class Crowd:
    first: Sdf.Path  # uninstanced, to be posed
    others: list[Sdf.Path]  # instances that take over its pose


def contains_skel_root(prim: Usd.Prim) -> bool:
    return any(type_name(below) == "SkelRoot" for below in find_below(prim))


def drawn_prims(stage: Usd.Stage) -> Iterable[Usd.Prim]:
    """Return the prims in the world, and point instancers' prototypes elsewhere."""
    return chain(world_prims(stage), *map(find_below, instanced_elsewhere(stage)))


def instanced_elsewhere(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Yield point instancers' prototypes below `class` or `over` prims; for parts of a SkelRoot, the SkelRoot, which is posed
    as a whole."""
    for root in instanced_roots(stage):
        if not root.IsInPrototype() and not is_in_world(root):
            above = map(stage.GetPrimAtPath, root.GetPath().GetPrefixes())
            yield next((prim for prim in above if type_name(prim) == "SkelRoot"), root)


def is_skel_root(prim: Usd.Prim) -> bool:
    return bool(type_name(prim) == "SkelRoot" and not prim.IsInstance())


def uninstance(stage: Usd.Stage, most: int, times: Sequence[When], diagnostics: Diagnostics) -> list[Crowd]:
    """Uninstance native instances that contain skeletons, or things that a skeleton moves or needs, up to `most` at a time.

    Instances that keep their authored pose are reported. Instances share a pose only if it is the same at all `times`.
    """
    if not stage.GetPrototypes():
        return []
    crowds: list[Crowd] = []
    waiting: set[Sdf.Path] = set()  # for the pose of their crowd
    left: set[Sdf.Path] = set()
    while True:
        apart = [path for path in _instances_with_roots(stage) if path not in waiting and path not in left]
        if len(apart) > most:
            alike = _grouped_by_pose(stage, apart, times)
            if len(alike) <= most:
                crowds += [Crowd(first, others) for first, *others in alike]
                waiting.update(path for _, *others in alike for path in others)
                apart = [first for first, *_ in alike]
        if not apart and stage.GetPrototypes():
            apart = [path for path in _instances_used_by_roots(stage) if path not in left]
        if not apart:
            return crowds
        if len(apart) > most:
            left.update(apart)
            _report_unposed(stage, apart, most, diagnostics)
            continue
        for path in apart:
            end_instance(stage.GetPrimAtPath(path))


def share_poses(stage: Usd.Stage, crowds: list[Crowd], layers: list[Sdf.Layer]) -> None:
    """Give the other instances of each crowd what these session layers author below its first one, which becomes an instance
    again.

    Later crowds come first, since they may be inside what earlier ones hand over. Raises OpinionsLeak if other prims compose
    one of the instances.
    """
    for crowd in reversed(crowds):
        others = [path for path in crowd.others if stage.GetPrimAtPath(path).IsInstance()]
        for path in others:
            if composed_by := composers(stage, path):
                raise OpinionsLeak(f"{min(composed_by)} would be posed as {path}")
        if others:
            _share(stage, crowd.first, others, layers)


def _instances_with_roots(stage: Usd.Stage) -> list[Sdf.Path]:
    """Return the instances that are SkelRoots or contain some, directly or in nested instances."""
    holding = _holding_prototypes(stage)
    instances = (prim for prim in drawn_prims(stage) if prim.IsInstance())
    found = [p for p in instances if type_name(p) == "SkelRoot" or str(p.GetPrototype().GetPath()) in holding]
    return list(dict.fromkeys(prim.GetPath() for prim in found))


def _holding_prototypes(stage: Usd.Stage) -> set[str]:
    """Return the paths of prototypes that contain a skeleton, directly or in nested instances."""
    prototypes = stage.GetPrototypes()
    held = {str(p.GetPath()): {str(i.GetPrototype().GetPath()) for i in find_below(p) if i.IsInstance()} for p in prototypes}
    found = {str(p.GetPath()) for p in prototypes if contains_skel_root(p)}
    while more := {path for path, inner in held.items() if path not in found and inner & found}:
        found |= more
    return found


def _instances_used_by_roots(stage: Usd.Stage) -> list[Sdf.Path]:
    """Return the instances around meshes, skeletons and animations that SkelRoots outside them use."""
    from pxr import UsdSkel

    found: dict[Sdf.Path, None] = {}
    for root in [prim for prim in drawn_prims(stage) if is_skel_root(prim)]:
        try:
            prims = [prim for binding in bindings_below(UsdSkel.Root(root)) for prim in prims_of_binding(binding)]
        except FAILURES:  # posing reports the failure
            continue
        found.update((_instance_around(prim), None) for prim in prims if prim.IsInstanceProxy())
    return list(found)


def _instance_around(prim: Usd.Prim) -> Sdf.Path:
    """Return the outermost instance around an instance proxy."""
    while prim.IsInstanceProxy():
        prim = prim.GetParent()
    return prim.GetPath()


def _report_unposed(stage: Usd.Stage, instances: list[Sdf.Path], most: int, diagnostics: Diagnostics) -> None:
    by_prototype: dict[Sdf.Path, list[Sdf.Path]] = {}
    for path in instances:
        by_prototype.setdefault(stage.GetPrimAtPath(path).GetPrototype().GetPath(), []).append(path)
    for first, *others in by_prototype.values():
        message = f"There are more than {most:,} instances with skinned meshes in different poses"
        among = f" ({1 + len(others):,} of this prototype)" if others else ""
        diagnostics.add("skinning", str(first), f"{message}{among}: they are rendered in their authored pose.")


def _grouped_by_pose(stage: Usd.Stage, instances: list[Sdf.Path], times: Sequence[When]) -> list[list[Sdf.Path]]:
    """Return the instances grouped by their prototype and by what is bound to them from outside it."""
    places = [(when, transforms(when)) for when in times]
    bound_to = [_InheritedBindings(when) for when in times]
    outside = {str(p.GetPath()): _leads_outside(p) for p in stage.GetPrototypes()}
    found: dict[object, list[Sdf.Path]] = {}
    for path in instances:
        prim = stage.GetPrimAtPath(path)
        prototype, bound = str(prim.GetPrototype().GetPath()), tuple(then(prim) for then in bound_to)
        # The pose of a mesh bound to a skeleton elsewhere depends on where the mesh is.
        is_bound_outside = outside[prototype] or any(
            name == "skel:skeleton" and text.startswith("/") for name, text in bound[0]
        )
        place = tuple(_place(prim, *then) for then in places) if is_bound_outside else ()
        found.setdefault((prototype, bound, place), []).append(path)
    return list(found.values())


def _place(prim: Usd.Prim, when: When, places: UsdGeom.XformCache) -> object:
    return tuple(map(tuple, world_matrix(prim, when, places)))


class _InheritedBindings:
    """Skeletons, animations and influences inherited by an instance: property names and values, as text."""

    def __init__(self, when: When) -> None:
        self._when = when
        self._above: dict[Sdf.Path, dict[str, Usd.Prim]] = {}

    def __call__(self, instance: Usd.Prim) -> tuple[tuple[str, str], ...]:
        path = instance.GetPath()
        return tuple((name, self._text(prim, name, path)) for name, prim in sorted(self._authors(instance).items()))

    def _authors(self, prim: Usd.Prim) -> dict[str, Usd.Prim]:
        """Return the nearest ancestor that authors each binding property; cached for parents of many instances."""
        if not prim or prim.IsPseudoRoot():
            return {}
        parent = prim.GetParent()
        if parent.GetPath() not in self._above:
            self._above[parent.GetPath()] = self._authors(parent)
        return self._above[parent.GetPath()] | {name: prim for name in property_names(prim) if name.startswith(_BINDING)}

    def _text(self, author: Usd.Prim, name: str, instance: Sdf.Path) -> str:
        if author.GetRelationship(name):
            bound = targets(author, name)
            return " ".join(str(t.MakeRelativePath(instance) if t.HasPrefix(instance) else t) for t in bound)
        return str(read(author, name, self._when))


def _leads_outside(prototype: Usd.Prim) -> bool:
    """Return whether a prim in the prototype is bound to a skeleton outside it."""
    bound = (target for prim in all_prims_in_instances(prototype) for target in targets(prim, "skel:skeleton"))
    return any(not target.HasPrefix(prototype.GetPath()) for target in bound)


def _share(stage: Usd.Stage, first: Sdf.Path, others: list[Sdf.Path], layers: list[Sdf.Layer]) -> None:
    session = stage.GetSessionLayer()
    posed = _free_path(stage)
    is_itself_posed = type_name(stage.GetPrimAtPath(others[0])) == "SkelRoot"
    with Sdf.ChangeBlock():
        Sdf.CreatePrimInLayer(session, posed).specifier = Sdf.SpecifierClass
        for layer in layers:
            _move_children(layer, first, posed)
        first_spec = session.GetPrimAtPath(first)
        first_spec.ClearInfo("instanceable")
        if first_spec.HasInfo("customData"):
            copy_marks(first_spec, session.GetPrimAtPath(posed))
        for path in [first, *others]:
            spec = Sdf.CreatePrimInLayer(session, path)
            spec.inheritPathList.Prepend(posed)
            if is_itself_posed:
                spec.typeName = "Xform"  # the type that baking gives a SkelRoot


def _free_path(stage: Usd.Stage) -> Sdf.Path:
    """Return a path that no layer has a prim at, whatever the stage's population mask."""
    layers = stage.GetLayerStack()
    names = (Sdf.Path(f"/posed_{k}") for k in count())
    return next(path for path in names if not any(layer.GetPrimAtPath(path) for layer in layers))


def _move_children(layer: Sdf.Layer, source: Sdf.Path, target: Sdf.Path) -> None:
    spec = layer.GetPrimAtPath(source)
    names = [child.name for child in spec.nameChildren] if spec else []
    if names:
        Sdf.CreatePrimInLayer(layer, target)
    for name in names:
        Sdf.CopySpec(layer, source.AppendChild(name), layer, target.AppendChild(name))
        del spec.nameChildren[name]
