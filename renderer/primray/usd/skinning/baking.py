"""Skinning of meshes by USD itself (UsdSkel.BakeSkinning): joints, blend shapes, normals.

The posed values are opinions in the session layer of another stage on the same layers, so neither files nor the caller's stage
change. Baking visits authored samples only, so everything that a pose depends on is first authored at the times of the poses.
It does not reach into native instances: those with skeletons are uninstanced there, or posed as crowds, up to MAX_UNINSTANCED.
Meshes there are marked as posed or not, for the traversal (bindings.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pxr import Gf, Sdf, Usd

from ...diagnostics import Diagnostics
from ..motion.timing import Foreseen
from ..stage.edits import check_reach, temporarily_defined
from ..stage.open import scratch_copy
from ..stage.reads import FAILURES, authored_attributes, why
from ..stage.time_varying import has_time_values
from ..stage.traversal import find_below, instanced_roots, is_in_world
from ..stage.values import When, value
from .bindings import NOT_APPLIED, UNBOUND, SkeletonBinding, bindings_below, has_mark, has_weights, lacks_animation, mark_posing
from .instances import contains_skel_root, drawn_prims, instanced_elsewhere, is_skel_root, share_poses, uninstance
from .normals import author_normals, make_bakeable, rotated_normals, take_unbaked_normals
from .pose_times import PoseTimes, pose_times

if TYPE_CHECKING:
    from pxr import UsdSkel  # imported only for stages with skeletons: it takes as long as starting Python


MAX_UNINSTANCED = 1000
_BAKED_SHAPE = ("points", "xformOp:transform")  # the last for shapes that one joint moves rigidly


def any_drawn(stage: Usd.Stage, skeletons: list[Usd.Prim]) -> bool:
    """Return whether any of these SkelRoots is in the world, in a native prototype, or in what a point instancer draws."""
    if any(prim.IsInPrototype() or is_in_world(prim) for prim in skeletons):
        return True
    return bool(skeletons) and any(map(contains_skel_root, instanced_elsewhere(stage)))


def posed_stage(stage: Usd.Stage, when: When, seen: Foreseen, diagnostics: Diagnostics) -> Usd.Stage:
    """Return a copy of the stage posed by its skeletons at the frame, and as often as needed while the shutter is open."""
    from pxr import UsdSkel

    made = scratch_copy(stage)
    session = made.GetSessionLayer()
    made.SetEditTarget(session)
    layers = _layers_below(made, seen)
    crowds = uninstance(made, MAX_UNINSTANCED, _times_to_compare(when, seen), diagnostics)
    paths = list(dict.fromkeys(str(prim.GetPath()) for prim in drawn_prims(made) if is_skel_root(prim)))
    with temporarily_defined(made, paths):
        loose = [crowd.first for crowd in crowds] + [prim.GetPath() for prim in instanced_roots(made)]
        posing = _Posing(layers, when, _pose_times_by_root(made, paths, loose, when, seen, diagnostics), diagnostics)
        for path in paths:
            if root := UsdSkel.Root(made.GetPrimAtPath(path)):  # baking turns it and nested SkelRoots into Xforms
                _pose(root, posing)
        check_reach(made, dict.fromkeys([session, layers.held, layers.kept]))
    if layers.held != layers.kept:
        session.subLayerPaths.remove(layers.held.identifier)
    share_poses(made, crowds, [session, layers.kept])
    return made


@dataclass(frozen=True, eq=False)
class _Layers:
    """Sublayers of the session layer, which itself then contains only what baking writes."""

    held: Sdf.Layer  # values authored at the times of the poses
    kept: Sdf.Layer  # other authored values; the same layer if everything is seen at the frame


@dataclass(frozen=True, eq=False)
class _Posing:
    layers: _Layers
    when: When
    times: Mapping[str, PoseTimes]  # by root, for those posed at more times than the frame
    diagnostics: Diagnostics


def _layers_below(stage: Usd.Stage, seen: Foreseen) -> _Layers:
    """Insert the layers for held values; values held for posing alone must not stay once meshes are posed at several times."""
    held = Sdf.Layer.CreateAnonymous("held.usda")
    kept = held if seen.timing.is_frame else Sdf.Layer.CreateAnonymous("kept.usda")
    for layer in dict.fromkeys([held, kept]):
        stage.GetSessionLayer().subLayerPaths.insert(0, layer.identifier)
    return _Layers(held, kept)


def _times_to_compare(when: When, seen: Foreseen) -> list[When]:
    """Return the times at which poses must be equal to be shared."""
    opens, closes = seen.timing.span
    return [when.after(offset) for offset in sorted({0.0, opens, 0.5 * (opens + closes), closes})]


def _pose_times_by_root(
    stage: Usd.Stage, roots: list[str], loose: list[Sdf.Path], when: When, seen: Foreseen, diagnostics: Diagnostics
) -> dict[str, PoseTimes]:
    """Return the pose times of all roots, before values are held for any of them. `loose` are prims that are also drawn
    elsewhere than at their path."""
    if seen.timing.is_frame:
        return {}
    from pxr import UsdSkel

    found = {}
    for path in roots:
        is_placed = not any(Sdf.Path(path).HasPrefix(other) for other in loose)
        try:
            bindings = bindings_below(UsdSkel.Root(stage.GetPrimAtPath(path)))
            times = pose_times(bindings, when, seen, is_placed)
        except FAILURES:  # posing reports the failure
            continue
        if times is not None:
            found[path] = times
            if times.steps is not None and times.steps.error > seen.most:
                left = f"with {times.steps.segments} segments of motion, points are up to {times.steps.error:.2g} pixels off."
                diagnostics.add("motion", path, f"Its pose changes fast: {left}")
    return found


def _pose(root: UsdSkel.Root, posing: _Posing) -> None:
    path, diagnostics = str(root.GetPath()), posing.diagnostics
    mark_posing(root.GetPrim())
    try:
        bindings = bindings_below(root)
        problem = _bake(root, bindings, posing)
        if _mark_baked(bindings):
            diagnostics.add("posed", path, "Meshes below are posed by their skeleton.")
    except FAILURES as error:
        problem = f"USD cannot pose it: {why(error)}"
    if problem:
        diagnostics.add("skinning", path, problem)
    else:
        _mark_others(root.GetPrim(), bindings)


def _bake(root: UsdSkel.Root, bindings: list[SkeletonBinding], posing: _Posing) -> str:
    """Bake the poses of one root; return what went wrong, or ""."""
    from pxr import UsdSkel

    if any(prim and prim.IsInstanceProxy() for binding in bindings for prim in (binding.skeleton, binding.animation)):
        return "Its skeleton or animation is in one of too many instances: meshes below it are rendered in their authored pose."
    stage, when, times = root.GetPrim().GetStage(), posing.when, posing.times.get(str(root.GetPath()))
    with Usd.EditContext(stage, posing.layers.held):
        author_pose_values(root.GetPrim(), bindings, posing.layers.held, when, times)
    loose = []
    with Usd.EditContext(stage, posing.layers.kept):
        for of, query in ((binding, query) for binding in bindings for query in binding.targets):
            is_bent = query.HasBlendShapes() or (query.HasJointInfluences() and not query.IsRigidlyDeformed())
            if is_bent and not query.GetPrim().IsInstanceProxy():
                make_bakeable(query.GetPrim())
                loose.append(take_unbaked_normals(of, query))
    times_of_poses = [time_code(when, offset) for offset in times.offsets] if times else [Usd.TimeCode.Default()]
    turned = [rotated_normals(each, times_of_poses) for each in loose if each is not None]
    span = [time_code(when, offset).GetValue() for offset in (times.offsets[0], times.offsets[-1])] if times else (0, 0)
    if not UsdSkel.BakeSkinning(root, Gf.Interval(*span)):
        return "USD cannot pose it."
    for normals in turned:
        author_normals(normals)
    if times and when.is_default:
        block_defaults(stage.GetSessionLayer(), bindings)
    return ""


def _mark_baked(bindings: list[SkeletonBinding]) -> bool:
    """Mark the posed meshes and return whether there are any; baking skips silently what it cannot pose."""
    is_any_posed = False
    for binding in bindings:
        reason = lacks_animation(binding)
        for prim in (query.GetPrim() for query in binding.targets):
            if any(
                _is_written(prim.GetStage().GetSessionLayer(), prim.GetPath().AppendProperty(name)) for name in _BAKED_SHAPE
            ):
                mark_posing(prim, f"{reason}: the skeleton is in its rest pose" if reason else "")
                is_any_posed = is_any_posed or not reason
    return is_any_posed


def _is_written(layer: Sdf.Layer, path: Sdf.Path) -> bool:
    """Return whether the attribute has a value: USD creates attributes before it finds that weights do not fit."""
    spec = layer.GetAttributeAtPath(path)
    return bool(spec and (spec.HasInfo("default") or layer.GetNumTimeSamplesForPath(path)))


def _mark_others(root: Usd.Prim, bindings: list[SkeletonBinding]) -> None:
    bound = {query.GetPrim().GetPath() for binding in bindings for query in binding.targets}
    for prim in find_below(root):
        if has_weights(prim) and not has_mark(prim):
            mark_posing(prim, _why_not_baked(prim, bound))


def _why_not_baked(prim: Usd.Prim, bound: set[Sdf.Path]) -> str:
    if not prim.HasAPI("SkelBindingAPI"):
        return NOT_APPLIED
    if prim.GetPath() in bound:
        return "USD's skinning rejects its weights, joint indices or points"
    return "" if any(path.HasPrefix(prim.GetPath()) for path in bound) else UNBOUND  # weights may apply to descendants


BAKED_ATTRIBUTES = ("points", "normals", "extent", "xformOp:transform")  # the last for shapes that one joint moves rigidly


def author_pose_values(
    root: Usd.Prim, bindings: list[SkeletonBinding], layer: Sdf.Layer, when: When, times: PoseTimes | None
) -> None:
    """Author, in this layer (the stage's edit target), samples at all pose times for attributes that move poses, and the value
    at the frame for the others."""
    for prim in _involved(root, bindings):
        for attribute in authored_attributes(prim):
            if layer.GetNumTimeSamplesForPath(attribute.GetPath()):  # samples for another root's times
                attribute.Clear()
            if has_time_values(attribute):
                _author_samples(attribute, when, times)
    if times is not None:
        for query in (query for binding in bindings for query in binding.targets):
            _author_bind_transform(query, when, times)


def _author_bind_transform(query: UsdSkel.SkinningQuery, when: When, times: PoseTimes) -> None:
    """Author the geom bind transform at all pose times: baking does not check whether transforms of skeletons and meshes have
    samples."""
    from pxr import UsdSkel

    if not query.HasJointInfluences() or query.GetPrim().IsInstanceProxy():
        return
    present = query.GetGeomBindTransform(when.time)
    attribute = UsdSkel.BindingAPI(query.GetPrim()).CreateGeomBindTransformAttr(present)
    for offset in times.offsets:
        attribute.Set(present, time_code(when, offset))


def _author_samples(attribute: Usd.Attribute, when: When, times: PoseTimes | None) -> None:
    present = value(attribute, when)
    if present is None:
        return
    if times is None or str(attribute.GetPath()) not in times.moving:
        attribute.Set(present)
        return
    found = [(time_code(when, offset), value(attribute, when.after(offset))) for offset in times.offsets]
    attribute.Set(present)
    for time, then in found:
        if then is not None:
            attribute.Set(then, time)


def time_code(when: When, offset: float) -> Usd.TimeCode:
    """Return the time code of a pose; with the default time the first sample is at the frame."""
    return Usd.TimeCode(offset if when.is_default else when.number + offset)


def block_defaults(layer: Sdf.Layer, bindings: list[SkeletonBinding]) -> None:
    """Block the defaults of baked attributes with samples: at the default time they are read at their first sample only if no
    default is found, not even a weaker one."""
    for binding in bindings:
        for query in binding.targets:
            for name in BAKED_ATTRIBUTES:
                spec = layer.GetAttributeAtPath(query.GetPrim().GetPath().AppendProperty(name))
                if spec and layer.GetNumTimeSamplesForPath(spec.path):
                    spec.default = Sdf.ValueBlock()


def _involved(root: Usd.Prim, bindings: list[SkeletonBinding]) -> Iterator[Usd.Prim]:
    """Yield every prim that the pose depends on: the root with its ancestors and descendants, skeletons and animations."""
    yield from _ancestors(root)
    yield from find_below(root)
    for binding in bindings:
        if not binding.skeleton.GetPath().HasPrefix(root.GetPath()):
            yield binding.skeleton
            yield from _ancestors(binding.skeleton)
        if binding.animation:
            yield binding.animation


def _ancestors(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    while (prim := prim.GetParent()) and not prim.IsPseudoRoot():
        yield prim
