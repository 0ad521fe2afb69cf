"""Meshes bound to skeletons, posed by USD's own skinning (UsdSkel.BakeSkinning): joints, blend shapes, normals.

The posed values are opinions in the session layer of another stage on the same layers, so neither files nor the caller's stage
change. Baking does not reach into native instances: those with skeletons are taken apart there, or posed as crowds, up to
MAX_TAKEN_APART. What was posed and what was not is marked on the meshes there, for whoever passes them (querying.skin_marks).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from pxr import Gf, Sdf, Usd

from ...diagnostics import Diagnostics
from ..opening.stage import scratch_copy
from ..querying.guarded import FAILURES, authored_attributes, why
from ..querying.skin_marks import NOT_APPLIED, UNBOUND, has_weights, is_marked, mark
from ..querying.standing import standing_in_world
from ..querying.time_varying import has_times
from ..querying.traversal import stands_in_world, there_below
from ..resolving.read import When, value
from .posed_normals import make_bakeable
from .skeleton_bindings import SkeletonBinding, bindings_below, lacks_animation
from .skinned_instances import drawn, has_root, instanced_elsewhere, is_root, share_poses, take_apart

if TYPE_CHECKING:
    from pxr import UsdSkel  # imported where a stage has skeletons: it takes as long as Python itself

MAX_TAKEN_APART = 1000
_BAKED = ("points", "xformOp:transform")  # the latter of what one joint moves as a whole


def are_drawn(stage: Usd.Stage, skeletons: list[Usd.Prim]) -> bool:
    """Whether any of these SkelRoots is in the world, in a native prototype, or in what a point instancer draws."""
    if any(prim.IsInPrototype() or stands_in_world(prim) for prim in skeletons):
        return True
    return bool(skeletons) and any(map(has_root, instanced_elsewhere(stage)))


def posed(stage: Usd.Stage, when: When, diagnostics: Diagnostics) -> Usd.Stage:
    """The stage as its skeletons pose it."""
    from pxr import UsdSkel

    made = scratch_copy(stage)
    made.SetEditTarget(made.GetSessionLayer())
    held = _layer_for_held_values(made)
    crowds = take_apart(made, MAX_TAKEN_APART, when, diagnostics)
    paths = list(dict.fromkeys(str(prim.GetPath()) for prim in drawn(made) if is_root(prim)))
    with standing_in_world(made, paths):
        for path in paths:
            if root := UsdSkel.Root(made.GetPrimAtPath(path)):  # baking makes Xforms of it and of those below
                _pose(root, held, when, diagnostics)
    share_poses(made, crowds, [made.GetSessionLayer(), held])
    return made


def _layer_for_held_values(stage: Usd.Stage) -> Sdf.Layer:
    """Below the session layer itself, in which there is then nothing but what baking wrote."""
    layer = Sdf.Layer.CreateAnonymous("held.usda")
    stage.GetSessionLayer().subLayerPaths.insert(0, layer.identifier)
    return layer


def _pose(root: UsdSkel.Root, held: Sdf.Layer, when: When, diagnostics: Diagnostics) -> None:
    path = str(root.GetPath())
    mark(root.GetPrim())
    try:
        bindings = bindings_below(root)
        problem = _bake(root, bindings, held, when)
        if _mark_baked(bindings):
            diagnostics.add("posed", path, "Meshes below are posed by their skeleton.")
    except FAILURES as error:
        problem = f"USD cannot pose it: {why(error)}"
    if problem:
        diagnostics.add("skinning", path, problem)
    else:
        _mark_others(root.GetPrim(), bindings)


def _bake(root: UsdSkel.Root, bindings: list[SkeletonBinding], held: Sdf.Layer, when: When) -> str:
    """What went wrong, if anything. Baking visits authored samples only, so all that moves is first held where it now is."""
    from pxr import UsdSkel

    if any(prim and prim.IsInstanceProxy() for binding in bindings for prim in (binding.skeleton, binding.animation)):
        return "Its skeleton or animation is in one of very many instances: meshes below are rendered as they are authored."
    with Usd.EditContext(root.GetPrim().GetStage(), held):
        _hold(root.GetPrim(), bindings, when)
        for query in (query for binding in bindings for query in binding.targets):
            is_bent = query.HasBlendShapes() or (query.HasJointInfluences() and not query.IsRigidlyDeformed())
            if is_bent and not query.GetPrim().IsInstanceProxy():
                make_bakeable(query.GetPrim())
    return "" if UsdSkel.BakeSkinning(root, Gf.Interval(0, 0)) else "USD cannot pose it."


def _hold(root: Usd.Prim, bindings: list[SkeletonBinding], when: When) -> None:
    for prim in _involved(root, bindings):
        for attribute in authored_attributes(prim):
            if has_times(attribute):
                present = value(attribute, when)
                if present is not None:
                    attribute.Set(present)


def _involved(root: Usd.Prim, bindings: list[SkeletonBinding]) -> Iterator[Usd.Prim]:
    """Everything that the pose depends on: what stands above and below the root, skeletons and animations."""
    yield from _above(root)
    yield from there_below(root)
    for binding in bindings:
        if not binding.skeleton.GetPath().HasPrefix(root.GetPath()):
            yield binding.skeleton
            yield from _above(binding.skeleton)
        if binding.animation:
            yield binding.animation


def _above(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    while (prim := prim.GetParent()) and not prim.IsPseudoRoot():
        yield prim


def _mark_baked(bindings: list[SkeletonBinding]) -> bool:
    """Whether any mesh has been posed; baking leaves out without a word what it cannot pose."""
    is_any_posed = False
    for binding in bindings:
        reason = lacks_animation(binding)
        for prim in (query.GetPrim() for query in binding.targets):
            if any(_is_written(prim.GetStage().GetSessionLayer(), prim.GetPath().AppendProperty(name)) for name in _BAKED):
                mark(prim, f"{reason}: the skeleton is at rest" if reason else "")
                is_any_posed = is_any_posed or not reason
    return is_any_posed


def _is_written(layer: Sdf.Layer, path: Sdf.Path) -> bool:
    """With a value: USD makes the attributes before it finds that weights do not fit."""
    spec = layer.GetAttributeAtPath(path)
    return bool(spec and (spec.HasInfo("default") or layer.GetNumTimeSamplesForPath(path)))


def _mark_others(root: Usd.Prim, bindings: list[SkeletonBinding]) -> None:
    bound = {query.GetPrim().GetPath() for binding in bindings for query in binding.targets}
    for prim in there_below(root):
        if has_weights(prim) and not is_marked(prim):
            mark(prim, _why_not_baked(prim, bound))


def _why_not_baked(prim: Usd.Prim, bound: set[Sdf.Path]) -> str:
    if not prim.HasAPI("SkelBindingAPI"):
        return NOT_APPLIED
    if prim.GetPath() in bound:
        return "USD does not pose it with these weights, joint indices and points"
    return "" if any(path.HasPrefix(prim.GetPath()) for path in bound) else UNBOUND  # weights may be for what is below
