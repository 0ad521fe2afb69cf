"""Native instances that skeletons have to do with: baking does not reach into them, so they are taken apart on a stage of ours.

Where they are too many, those that are posed alike become one crowd: one of them is posed, and a class in the session layer
hands its pose to all, which stay instances.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, count

from pxr import Sdf, Usd, UsdGeom

from ...diagnostics import Diagnostics
from ..opening.reach import OpinionsLeak, composers, end_instance
from ..querying.guarded import FAILURES, property_names, targets, type_name
from ..querying.skin_marks import copy_marks
from ..querying.traversal import everything_in_instances, in_world, instanced_roots, stands_in_world, there_below
from ..resolving.read import When, read
from ..resolving.resolve import transforms, world_matrix
from .skeleton_bindings import bindings_below, concerned

_BINDING = ("skel:", "primvars:skel:")


@dataclass
class Crowd:
    first: Sdf.Path  # taken apart, to be posed
    others: list[Sdf.Path]  # instances that take over its pose


def has_root(prim: Usd.Prim) -> bool:
    return any(type_name(below) == "SkelRoot" for below in there_below(prim))


def drawn(stage: Usd.Stage) -> Iterable[Usd.Prim]:
    """The prims of the world, and those that point instancers lead to elsewhere."""
    return chain(in_world(stage), *map(there_below, instanced_elsewhere(stage)))


def instanced_elsewhere(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """The prototypes of point instancers that stand below `class` or `over`; a part of a SkelRoot is posed with all of it."""
    for root in instanced_roots(stage):
        if not root.IsInPrototype() and not stands_in_world(root):
            above = map(stage.GetPrimAtPath, root.GetPath().GetPrefixes())
            yield next((prim for prim in above if type_name(prim) == "SkelRoot"), root)


def is_root(prim: Usd.Prim) -> bool:
    return bool(type_name(prim) == "SkelRoot" and not prim.IsInstance())


def take_apart(stage: Usd.Stage, most: int, times: Sequence[When], diagnostics: Diagnostics) -> list[Crowd]:
    """Instances with skeletons in them, or with what a skeleton moves or needs, become prims of their own: `most` at a time.

    What stays an instance in its authored pose is told. `times`: when those that are posed alike must be so.
    """
    if not stage.GetPrototypes():
        return []
    crowds: list[Crowd] = []
    waiting: set[Sdf.Path] = set()  # for the pose of their crowd
    left: set[Sdf.Path] = set()
    while True:
        apart = [path for path in _with_roots(stage) if path not in waiting and path not in left]
        if len(apart) > most:
            alike = _posed_alike(stage, apart, times)
            if len(alike) <= most:
                crowds += [Crowd(first, others) for first, *others in alike]
                waiting.update(path for _, *others in alike for path in others)
                apart = [first for first, *_ in alike]
        if not apart and stage.GetPrototypes():
            apart = [path for path in _reached(stage) if path not in left]
        if not apart:
            return crowds
        if len(apart) > most:
            left.update(apart)
            _tell(stage, apart, most, diagnostics)
            continue
        for path in apart:
            end_instance(stage.GetPrimAtPath(path))


def share_poses(stage: Usd.Stage, crowds: list[Crowd], layers: list[Sdf.Layer]) -> None:
    """Let the others of each crowd have what these layers of the session say below its first, which is an instance again.

    The last crowds come first: they may stand in what earlier ones hand over. OpinionsLeak where prims compose one of them.
    """
    for crowd in reversed(crowds):
        others = [path for path in crowd.others if stage.GetPrimAtPath(path).IsInstance()]
        for path in others:
            if composed_by := composers(stage, path):
                raise OpinionsLeak(f"{min(composed_by)} would be posed as {path}")
        if others:
            _share(stage, crowd.first, others, layers)


def _with_roots(stage: Usd.Stage) -> list[Sdf.Path]:
    """The instances that are SkelRoots or hold some, directly or in further instances."""
    holding = _holding_prototypes(stage)
    instances = (prim for prim in drawn(stage) if prim.IsInstance())
    found = [p for p in instances if type_name(p) == "SkelRoot" or str(p.GetPrototype().GetPath()) in holding]
    return list(dict.fromkeys(prim.GetPath() for prim in found))


def _holding_prototypes(stage: Usd.Stage) -> set[str]:
    """Paths of the prototypes with a skeleton in them, or in what they are made of."""
    prototypes = stage.GetPrototypes()
    held = {str(p.GetPath()): {str(i.GetPrototype().GetPath()) for i in there_below(p) if i.IsInstance()} for p in prototypes}
    found = {str(p.GetPath()) for p in prototypes if has_root(p)}
    while more := {path for path, inner in held.items() if path not in found and inner & found}:
        found |= more
    return found


def _reached(stage: Usd.Stage) -> list[Sdf.Path]:
    """The instances around meshes, skeletons and animations that SkelRoots outside have to do with."""
    from pxr import UsdSkel

    found: dict[Sdf.Path, None] = {}
    for root in [prim for prim in drawn(stage) if is_root(prim)]:
        try:
            prims = [prim for binding in bindings_below(UsdSkel.Root(root)) for prim in concerned(binding)]
        except FAILURES:  # posing will tell
            continue
        found.update((_instance_around(prim), None) for prim in prims if prim.IsInstanceProxy())
    return list(found)


def _instance_around(prim: Usd.Prim) -> Sdf.Path:
    """The outermost one."""
    while prim.IsInstanceProxy():
        prim = prim.GetParent()
    return prim.GetPath()


def _tell(stage: Usd.Stage, instances: list[Sdf.Path], most: int, diagnostics: Diagnostics) -> None:
    by_prototype: dict[Sdf.Path, list[Sdf.Path]] = {}
    for path in instances:
        by_prototype.setdefault(stage.GetPrimAtPath(path).GetPrototype().GetPath(), []).append(path)
    for first, *others in by_prototype.values():
        message = f"More than {most:,} instances with skinned meshes in poses of their own"
        among = f" ({1 + len(others):,} of this prototype)" if others else ""
        diagnostics.add("skinning", str(first), f"{message}{among}: they are rendered as they are authored.")


def _posed_alike(stage: Usd.Stage, instances: list[Sdf.Path], times: Sequence[When]) -> list[list[Sdf.Path]]:
    """The instances by their prototype and what is bound to them from outside it."""
    places = [(when, transforms(when)) for when in times]
    bound_to = [_Bound(when) for when in times]
    outside = {str(p.GetPath()): _leads_outside(p) for p in stage.GetPrototypes()}
    found: dict[object, list[Sdf.Path]] = {}
    for path in instances:
        prim = stage.GetPrimAtPath(path)
        prototype, bound = str(prim.GetPrototype().GetPath()), tuple(then(prim) for then in bound_to)
        # A mesh follows a skeleton that stands elsewhere from where it stands itself.
        is_bound_outside = outside[prototype] or any(
            name == "skel:skeleton" and text.startswith("/") for name, text in bound[0]
        )
        place = tuple(_place(prim, *then) for then in places) if is_bound_outside else ()
        found.setdefault((prototype, bound, place), []).append(path)
    return list(found.values())


def _place(prim: Usd.Prim, when: When, places: UsdGeom.XformCache) -> object:
    return tuple(map(tuple, world_matrix(prim, when, places)))


class _Bound:
    """What skeletons, animations and influences are handed down to an instance: names and values, as text."""

    def __init__(self, when: When) -> None:
        self._when = when
        self._above: dict[Sdf.Path, dict[str, Usd.Prim]] = {}

    def __call__(self, instance: Usd.Prim) -> tuple[tuple[str, str], ...]:
        path = instance.GetPath()
        return tuple((name, self._text(prim, name, path)) for name, prim in sorted(self._authors(instance).items()))

    def _authors(self, prim: Usd.Prim) -> dict[str, Usd.Prim]:
        """By the names of properties, the nearest prims that author them; a scope of many instances is asked once."""
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
    """Whether something in a prototype is bound to a skeleton that is not."""
    bound = (target for prim in everything_in_instances(prototype) for target in targets(prim, "skel:skeleton"))
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
                spec.typeName = "Xform"  # as baking leaves a SkelRoot


def _free_path(stage: Usd.Stage) -> Sdf.Path:
    """Where no layer has anything, seen through the stage's population mask or not."""
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
