"""The walk down the stage: prunes prims that are not rendered, expands instances into groups, and reports unsupported content.

Each native prototype and each point instancer's prototype is walked once per distinct state handed down to it. Prims below a
moving transform are a group with one instance, in the space of the moving transform: a car of 500 parts is one group.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from pxr import Gf, Usd, UsdGeom

from ...arrays import Doubles
from ...description.placement import IDENTITY, MatrixInstances, PointInstances, texts
from ..instancing.instances import Group
from ..instancing.prototypes import handed_to_prototype
from ..lights.light_links import Links
from ..materials.bound_materials import NativePrototype, bind_shapes, binding_key, bindings_of, bound_individually
from ..motion.attributes import animated_operations, bend_times, local_transform
from ..motion.levels import Local, Mover, MovingLevel, level_of
from ..primvars.surface_primvars import without_overridden
from ..shapes.draw_mode import draw_mode_of
from ..shapes.implicit import animated_sphere
from ..shapes.points import POINT, sphere_instances
from ..stage.reads import local_transform_at
from ..stage.traversal import IN_PROTOTYPE, IN_WORLD, children
from ..stage.values import time_of
from .bindings import binds_by_collection, note_bindings
from .context import NO_COLOR_SCOPE, Context
from .inheritance import Binding, Inherited, ResolvedPrim, as_bound, descend, inner_or_outer, is_drawn, local_matrix, transforms
from .notes import note_foreign_schemas, note_other_renderers, note_prim
from .poses import ROOT, Poses
from .prim_kinds import PrimKinds
from .translated_scene import Record


@dataclass(eq=False)
class Place:
    group: Group[ResolvedPrim]
    poses: Poses
    mover: Mover | None  # the space that the poses are in; None: the root's

    def mover_below(self, pose: int, local: Local, times: Iterable[float], *, resets: bool = False) -> Mover:
        """Return the mover of a transform below this pose or, where it resets the stack, below the root."""
        between: Doubles = np.eye(4) if resets else self.poses.at(pose)
        return Mover(None if resets else self.mover, between, local, times)


class Places:
    """Places by moving transform and motion:blurScale, since a blur scale applies to the whole path of a leaf to the world."""

    def __init__(self, groups: list[Group[ResolvedPrim]], own: Group[ResolvedPrim]) -> None:
        self._groups = groups
        self.own = Place(own, Poses(), None)
        self._known: dict[tuple[Mover | None, float], Place] = {(None, own.blur_scale): self.own}

    def of(self, mover: Mover | None, blur_scale: float, path: str) -> Place:
        """Return the place for prims in this mover's space; a new one gets this path as its name."""
        known = self._known.get((mover, blur_scale))
        if known is None:
            level = MatrixInstances(IDENTITY[None]) if mover is None else level_of([mover], np.eye(4)[None])
            self.own.group.instances.append((len(self._groups), level))
            known = self._known[mover, blur_scale] = Place(Group(path, blur_scale=blur_scale), Poses(), mover)
            self._groups.append(known.group)
        return known

    def blurred(self, place: Place, pose: int, blur_scale: float, path: str) -> tuple[Place, int]:
        """Return the same pose in the place for another blur scale."""
        other = self.of(place.mover, blur_scale, path)
        return other, other.poses.add(Gf.Matrix4d(place.poses.at(pose).T), ROOT)


Expand = Callable[
    [ResolvedPrim, Context], list[tuple[str, PointInstances | MovingLevel]]
]  # (prototype root, group_from_prototype)

# Prims of these types have no children that are drawn.
_CLOSED = frozenset({"Material", "Shader", "NodeGraph", "GeomSubset", "PointInstancer"})
_EXPANDED = frozenset({"PointInstancer", "Points"})  # expanded into groups
BOUND = frozenset({"shape", "volume"})  # kinds of leaves that materials are bound to
FORGOTTEN_AFTER = 1 << 14  # transforms after which the cache is cleared


@dataclass(frozen=True)
class GroupKey:
    root: str
    inherited: Inherited


class _Above(NamedTuple):
    """State that all children of a prim are given."""

    path: str
    place: Place
    pose: int
    inherited: Inherited
    binds: str  # the path of the nearest prim, this one or above it, that binds materials; "" for none


@dataclass(kw_only=True)
class _Walk:
    ctx: Context
    leaf_types: Mapping[str, str]
    expand: Expand
    cache: UsdGeom.XformCache
    kinds: PrimKinds
    has_instances: bool
    links: Links | None
    record: Record
    groups: list[Group[ResolvedPrim]] = field(default_factory=list)
    index: dict[GroupKey, int] = field(default_factory=dict)
    queue: list[tuple[int, Usd.Prim, Inherited]] = field(default_factory=list)
    prototypes: dict[Usd.Prim, NativePrototype] = field(default_factory=dict)

    def prototype(self, prim: Usd.Prim) -> NativePrototype:
        """Return the one object for a native prototype."""
        found = self.prototypes.get(prim)
        if found is None:
            found = self.prototypes[prim] = NativePrototype(prim)
        return found

    def group(self, root: Usd.Prim, inherited: Inherited) -> int:
        """Return the group of this prototype with the state handed to it; a new one is queued for walking."""
        key = GroupKey(str(root.GetPath()), inherited)
        if key not in self.index:
            self.index[key] = len(self.groups)
            self.groups.append(Group(self.ctx.shown(key.root), blur_scale=inherited.blur_scale))
            self.queue.append((self.index[key], root, inherited))
        return self.index[key]


def walk(
    ctx: Context, leaf_types: Mapping[str, str], expand: Expand, record: Record, links: Links | None = None
) -> list[Group[ResolvedPrim]]:
    """Return all groups, the world first. `leaf_types` names the prim types that have adapters; `expand` reads an instancer.

    `links` distinguishes instances that lights illuminate differently. Where prims are placed is noted in `record`.
    """
    kinds = PrimKinds(ctx, leaf_types)
    has_instances = bool(ctx.stage.GetPrototypes())
    state = _Walk(
        ctx=ctx,
        leaf_types=leaf_types,
        expand=expand,
        cache=transforms(ctx.when),
        kinds=kinds,
        has_instances=has_instances,
        links=links,
        record=record,
    )
    record.begin()
    state.group(ctx.stage.GetPseudoRoot(), Inherited())
    for index, root, inherited in state.queue:  # grows as instances are found
        _walk_group(state, state.groups[index], root, inherited)
    shapes = [leaf for group in state.groups for leaf in group.leaves if leaf_types[leaf.type_name] in BOUND]
    bind_shapes(shapes, kinds.by_collection, ctx)
    ctx.findings.property_names.update(kind.names for kind in kinds.found.values())
    note_other_renderers(kinds.found.values(), ctx)
    note_foreign_schemas(((kind, kind.foreign_schemas) for kind in kinds.found.values()), ctx)
    return state.groups


def _walk_group(state: _Walk, group: Group[ResolvedPrim], root: Usd.Prim, inherited: Inherited) -> None:
    ctx, places, native = state.ctx, Places(state.groups, group), list[ResolvedPrim]()
    is_namespace_root = root.IsPseudoRoot() or root.IsPrototype()
    drawn = IN_WORLD if is_namespace_root else IN_PROTOTYPE
    prims = children(root, drawn) if is_namespace_root else [root]
    parent = str((root if is_namespace_root else root.GetParent()).GetPath())
    # The ancestors of a point instancer's prototype are not walked, but the same whenever the prototype is.
    if not is_namespace_root:
        state.kinds.by_collection |= binds_by_collection(root.GetParent(), ctx)
    binds = "" if is_namespace_root else str(root.GetPath())
    top = _Above(ctx.shown(parent).removesuffix("/"), places.own, ROOT, inherited, binds)
    stack = [(prim, top) for prim in reversed(prims)]
    while stack:
        prim, above = stack.pop()
        path = f"{above.path}/{prim.GetName()}"
        kind = state.kinds.of(prim, path)
        type_name = kind.type_name
        mine = above.inherited
        if kind.hands_down:
            handed = descend(mine, prim, kind.handed_names, kind.schemas, ctx)
            if handed is None:
                continue
            mine = handed
        place, pose = above.place, above.pose
        if kind.has_transform:
            place, pose = _place_transform(state, places, prim, kind.names, path, above, mine.blur_scale)
        if mine.blur_scale != place.group.blur_scale:
            place, pose = places.blurred(place, pose, mine.blur_scale, path)
        is_instance = state.has_instances and prim.IsInstance()
        resolved: ResolvedPrim | None = None
        if (
            kind.taken_as
            or kind.is_noted
            or kind.bindings
            or is_instance
            or type_name in _EXPANDED
            or mine.draw_mode != "default"
        ):
            resolved = ResolvedPrim(
                prim=prim,
                path=path,
                type_name=type_name,
                names=kind.names,
                inherited=mine,
                poses=place.poses,
                pose=pose,
                bound_as=above.binds,
                mover=place.mover,
            )
            resolved.own_color = mine.color is not None and mine.color is not above.inherited.color
            drawn_as = draw_mode_of(resolved, ctx) if mine.draw_mode != "default" else ""
            if drawn_as:
                if is_drawn(mine, ctx.purposes) and not kind.left_out:
                    place.group.leaves.append(replace(resolved, type_name=drawn_as))
                continue
            if kind.is_noted:
                note_prim(resolved, kind.schemas, kind.taken_as, ctx)
            if kind.bindings:
                targets = note_bindings(prim, path, kind.bindings, ctx)
                resolved.bound_as = binding_key(kind, path, targets, above.binds)
            if type_name in _EXPANDED:
                state.record.note_use(place.poses, pose)
            if type_name == "PointInstancer":
                _expand_points(state, group, place.group, resolved, inherited if root.IsPrototype() else inherited.top)
                continue
            if type_name == "Points" and is_drawn(mine, ctx.purposes) and not kind.left_out:
                _place_spheres(state, group, place.group, resolved)
            if kind.taken_as and is_drawn(mine, ctx.purposes):  # an instance may be a shape too
                _place_leaf(state, places, place, resolved)
            if is_instance:
                state.record.note_use(place.poses, pose)
                native.append(resolved)
        if not is_instance and type_name not in _CLOSED and (below := children(prim, drawn)):
            mine_above = _Above(path, place, pose, mine, path if kind.bindings else above.binds)
            stack += [(child, mine_above) for child in reversed(below)]
    _expand_native(state, group, native, places.own.poses)


def _place_transform(
    state: _Walk, places: Places, prim: Usd.Prim, names: frozenset[str], path: str, above: _Above, blur_scale: float
) -> tuple[Place, int]:
    """Return the place and pose of a prim with a transform: below its parent's or, if the transform moves, in a new place."""
    ctx, place = state.ctx, above.place
    moving = animated_operations(prim, names, ctx.when, ctx.timing)
    if moving:
        _, resets = local_transform_at(prim, lambda attribute: time_of(attribute, ctx.when))
    else:
        local, resets = local_matrix(prim, names, ctx.when, state.cache)
    if resets and places.own.group is not state.groups[0]:
        message = "The transform is reset to the prototype's root, not to the world."
        ctx.warn("reset-xform-in-prototype", path, message, "xformOpOrder")
    if moving:
        mover = place.mover_below(
            above.pose, local_transform(prim, ctx.when), bend_times(moving, ctx.when, ctx.timing), resets=resets
        )
        return places.of(mover, blur_scale, path), ROOT
    if resets and place.mover is not None:
        place = places.of(None, place.group.blur_scale, path)
    pose = place.poses.add(local, above.pose, resets=resets)
    if places.own.group is state.groups[0]:
        state.record.note_pose(path, place.poses, pose)
    if pose % FORGOTTEN_AFTER == 0:
        state.cache.Clear()  # it keeps 400 bytes per prim, and no prim is asked for twice
    return place, pose


def _place_leaf(state: _Walk, places: Places, place: Place, leaf: ResolvedPrim) -> None:
    """Add a leaf to its place; a sphere whose radius changes is scaled by a moving transform."""
    grows = animated_sphere(leaf, state.ctx) if leaf.type_name == "Sphere" else None
    if grows is not None:
        place = places.of(place.mover_below(leaf.pose, *grows), place.group.blur_scale, leaf.path)
        leaf = replace(leaf, poses=place.poses, pose=ROOT, mover=place.mover)
    place.group.leaves.append(leaf)


def _expand_native(state: _Walk, group: Group[ResolvedPrim], instances: list[ResolvedPrim], poses: Poses) -> None:
    """Add native instances: those of one prototype that hand down the same state become one array of matrices."""
    ctx = state.ctx
    if not instances:
        return
    prototypes = [state.prototype(instance.prim.GetPrototype()) for instance in instances]
    bindings = bindings_of(instances, prototypes, state.kinds.by_collection, ctx)
    places = _matrices_of_instances(instances, poses)
    by_child: dict[int, list[int]] = {}
    names: dict[int, list[str]] = {}
    apart = bound_individually(instances, ctx)
    alike: dict[Hashable, int] = {}  # groups by prototype, inherited state and binding, which are shared objects
    for i, (instance, prototype, inner, alone) in enumerate(zip(instances, prototypes, bindings, apart, strict=True)):
        # Instances that collections look into are separate groups, and links distinguish every instance by its path.
        key = None if alone or state.links is not None else (id(prototype), id(instance.inherited), id(inner))
        child = alike.get(key)
        if child is None:
            ctx.prototype_names.setdefault(str(prototype.prim.GetPath()), instance.path)
            child = state.group(prototype.prim, _handed_to_instance(state, instance, prototype.prim, inner, alone))
            if key is not None:
                alike[key] = child
        by_child.setdefault(child, []).append(i)
        if ctx.names_instances:
            names.setdefault(child, []).append(_within(state, group, instance.path))
    for child, chosen in by_child.items():
        named = names.get(child)
        own = MatrixInstances(places[chosen, :3], names=None if named is None else texts(named))
        movers = [instances[i].mover for i in chosen]
        for level in _static_and_moving(own, movers, places[chosen]):
            group.instances.append((child, _finite(level, group, ctx)))


def _static_and_moving(instances: MatrixInstances, movers: list[Mover | None], inner: Doubles) -> list[MatrixInstances]:
    """Return the instances split into static and moving ones."""
    if not any(movers):
        return [instances]
    moving = np.array([mover is not None for mover in movers])
    level = level_of([mover for mover in movers if mover is not None], inner[moving])
    still, names = instances.take(np.flatnonzero(~moving)), instances.take(np.flatnonzero(moving)).names
    return [*([still] if len(still) else []), replace(level, names=names)]


def _matrices_of_instances(instances: list[ResolvedPrim], poses: Poses) -> Doubles:
    """Return group_from_instance (K, 4, 4), or mover_from_instance for moving ones. Most are in the group's own poses."""
    if all(instance.poses is poses for instance in instances):
        return poses.of([instance.pose for instance in instances])
    return np.stack([instance.group_from_prim for instance in instances])


def _handed_to_instance(
    state: _Walk, instance: ResolvedPrim, prototype: Usd.Prim, inner: Binding | None, alone: bool
) -> Inherited:
    mine = instance.inherited
    if mine.colors is not NO_COLOR_SCOPE:
        mine = replace(mine, outer_colors=((str(prototype.GetPath()), mine.colors), *mine.outer_colors))
    if mine.top is not None:
        mine = replace(mine, top=None)
    if alone:
        handed = replace(mine, proxy=str(as_bound(instance.prim, instance.inherited).GetPath()))
    else:
        handed = replace(mine, outer=inner_or_outer(inner, mine.outer), proxy="")
    return handed if state.links is None else state.links.handed_to_instance(handed, instance.prim, prototype)


def _within(state: _Walk, group: Group[ResolvedPrim], path: str) -> str:
    """Return a path relative to the root of its group, or the whole path in the world."""
    return path if group is state.groups[0] else path.removeprefix(group.path)


def _finite(level: MatrixInstances, group: Group[ResolvedPrim], ctx: Context) -> MatrixInstances:
    finite = np.isfinite(level.matrices).all(axis=(1, 2))
    if not finite.all():
        bad = int(np.count_nonzero(~finite))
        ctx.warn(
            "invalid-transform",
            group.path,
            f"{bad} of {len(level)} instances are not rendered: their transforms are not finite.",
        )
    return level if finite.all() else level.take(np.flatnonzero(finite))


def _expand_points(
    state: _Walk, root_group: Group[ResolvedPrim], group: Group[ResolvedPrim], instancer: ResolvedPrim, top: Inherited | None
) -> None:
    """Add the instances of a point instancer. `top` is handed to the native prototype that contains it; None in the world."""
    ctx = state.ctx
    for root_path, instances in state.expand(instancer, ctx):
        root = ctx.stage.GetPrimAtPath(root_path)
        if not root or not root.IsActive():
            continue
        handed = without_overridden(instancer.inherited, [p.name for p in instances.primvars])
        handed = handed_to_prototype(handed, instancer.prim, root, top, ctx)
        if state.links is not None:
            handed = state.links.handed_to_prototype(handed, instancer.prim, root)
        if root.IsInstanceProxy():
            root = root.GetPrimInPrototype()
        if instances.names is not None:
            within = _within(state, root_group, instancer.path)
            instances = replace(instances, names=replace(instances.names, prefix=within))
        group.instances.append((state.group(root, handed), instances))


def _place_spheres(state: _Walk, root_group: Group[ResolvedPrim], group: Group[ResolvedPrim], points: ResolvedPrim) -> None:
    """Add points as a group of one sphere with many instances; primvars that vary over the points become per instance."""
    placed = sphere_instances(points, state.ctx)
    if placed.names is not None:
        placed = replace(placed, names=replace(placed.names, prefix=_within(state, root_group, points.path)))
    varying = [p.name for p in placed.primvars]
    leaf = replace(
        points,
        type_name=POINT,
        names=points.names - {f"primvars:{name}" for name in varying},
        poses=Poses(),
        pose=ROOT,
        mover=None,
        inherited=without_overridden(points.inherited, varying),
    )
    to_group = points.group_from_prim
    if isinstance(placed, MovingLevel):
        placed = placed.placed(to_group[:3])
    else:
        matrices = to_group[:3, :3] @ placed.matrices
        matrices[:, :, 3] += to_group[:3, 3]
        placed = replace(placed, matrices=matrices)
    group.instances.append((len(state.groups), placed))
    state.groups.append(Group(points.path, [leaf], blur_scale=points.inherited.blur_scale))
