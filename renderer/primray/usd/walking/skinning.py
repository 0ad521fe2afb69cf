"""Meshes bound to skeletons, posed by USD's own skinning (UsdSkel.BakeSkinning): joints, blend shapes, normals.

The posed values are opinions in the session layer of another stage on the same layers, so neither files nor the caller's stage
change. Baking does not reach into native instances: those with skeletons are taken apart there, up to MAX_TAKEN_APART.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import TYPE_CHECKING

from pxr import Gf, Tf, Usd

from ...diagnostics import Diagnostics
from ..opening.stage import scratch_copy
from ..querying.guarded import authored_attributes, type_name
from ..querying.messages import tf_message
from ..querying.standing import standing_in_world
from ..querying.time_varying import has_times
from ..querying.traversal import THERE, in_world, instanced_roots, stands_in_world, there_below
from ..resolving.read import When, value

if TYPE_CHECKING:
    from pxr import UsdSkel  # imported where a stage has skeletons: it takes as long as Python itself

MAX_TAKEN_APART = 1000


def are_drawn(stage: Usd.Stage, skeletons: list[Usd.Prim]) -> bool:
    """Whether any of these SkelRoots is in the world, in a native prototype, or in what a point instancer draws."""
    if any(prim.IsInPrototype() or stands_in_world(prim) for prim in skeletons):
        return True
    return bool(skeletons) and any(map(_has_root, _instanced_elsewhere(stage)))


def posed(stage: Usd.Stage, when: When, diagnostics: Diagnostics) -> Usd.Stage:
    """The stage as its skeletons pose it."""
    from pxr import UsdSkel

    made = scratch_copy(stage)
    made.SetEditTarget(made.GetSessionLayer())
    _take_apart(made)
    paths = list(dict.fromkeys(str(prim.GetPath()) for prim in _drawn(made) if _is_root(prim)))
    with standing_in_world(made, paths):
        for path in paths:
            problem = _pose(UsdSkel.Root(made.GetPrimAtPath(path)), when)
            if problem:
                diagnostics.add("skinning", path, problem)
            else:
                diagnostics.add("posed", path, "Meshes below are posed by their skeleton.")
    return made


def _is_root(prim: Usd.Prim) -> bool:
    return bool(type_name(prim) == "SkelRoot" and not prim.IsInstance())


def _has_root(prim: Usd.Prim) -> bool:
    return any(type_name(below) == "SkelRoot" for below in there_below(prim))


def _drawn(stage: Usd.Stage) -> Iterable[Usd.Prim]:
    """The prims of the world, and those that point instancers lead to elsewhere."""
    return chain(in_world(stage), *map(there_below, _instanced_elsewhere(stage)))


def _instanced_elsewhere(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """The prototypes of point instancers that stand below `class` or `over`; a part of a SkelRoot is posed with all of it."""
    for root in instanced_roots(stage):
        if not root.IsInPrototype() and not stands_in_world(root):
            above = map(stage.GetPrimAtPath, root.GetPath().GetPrefixes())
            yield next((prim for prim in above if type_name(prim) == "SkelRoot"), root)


def _take_apart(stage: Usd.Stage) -> None:
    """Instances that hold skeletons, directly or in further instances, become prims of their own."""
    while True:
        holding = _holding_prototypes(stage)
        instances = [prim for prim in _drawn(stage) if prim.IsInstance()]
        found = [p for p in instances if type_name(p) == "SkelRoot" or str(p.GetPrototype().GetPath()) in holding]
        if not found or len(found) > MAX_TAKEN_APART:
            return
        for path in [prim.GetPath() for prim in found]:
            stage.GetPrimAtPath(path).SetInstanceable(False)


def _holding_prototypes(stage: Usd.Stage) -> set[str]:
    """Paths of the prototypes with a skeleton in them, or in what they are made of."""
    prototypes = stage.GetPrototypes()
    held = {str(p.GetPath()): {str(i.GetPrototype().GetPath()) for i in there_below(p) if i.IsInstance()} for p in prototypes}
    found = {str(p.GetPath()) for p in prototypes if _has_root(p)}
    while more := {path for path, inner in held.items() if path not in found and inner & found}:
        found |= more
    return found


def _pose(root: UsdSkel.Root, when: When) -> str:
    """What went wrong, if anything. Baking visits authored samples only, so all that moves is first held where it now is."""
    from pxr import UsdSkel

    try:
        for prim in _involved(root):
            for attribute in authored_attributes(prim):
                if has_times(attribute):
                    present = value(attribute, when)
                    if present is not None:
                        attribute.Set(present)
        return "" if UsdSkel.BakeSkinning(root, Gf.Interval(0, 0)) else "USD cannot pose it."
    except Tf.ErrorException as error:
        return f"USD cannot pose it: {tf_message(error)}"


def _involved(root: UsdSkel.Root) -> Iterator[Usd.Prim]:
    """Everything that the pose depends on: what stands above and below the root, and the animations."""
    from pxr import UsdSkel

    above = root.GetPrim().GetParent()
    while above and not above.IsPseudoRoot():
        yield above
        above = above.GetParent()
    yield from there_below(root.GetPrim())
    cache = UsdSkel.Cache()
    if cache.Populate(root, THERE):
        for binding in cache.ComputeSkelBindings(root, THERE):
            animation = cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery()
            if animation and not animation.GetPrim().IsInstanceProxy():
                yield animation.GetPrim()
