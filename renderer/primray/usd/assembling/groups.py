"""Conversion of groups of the walk to static shapes, or to prototypes and their placements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pxr import Tf

from ...arrays import Doubles
from ...description import Placed, Placement, Prototype, Shape
from ...description.instance_names import name_of
from ...description.placement import IDENTITY, MatrixInstances, chunks, named_levels, rows_of_levels
from ..lights.assembly import add_lights
from ..lights.geometry_light import with_light, without_material
from ..moving.levels import do_move
from ..moving.stands import Stands
from ..querying.messages import tf_message
from ..resolving.context import Context
from ..resolving.convert import square
from ..resolving.notes import LightShapes
from ..resolving.resolve import ResolvedPrim
from ..walking.instances import Arrangement, Chain, Group, count_of
from ..walking.record import Become, Record
from .scene import Scene


def shared_paths(groups: list[Group[ResolvedPrim]]) -> frozenset[str]:
    """Return the paths of prims that several groups contain, because their instances hand down different states."""
    seen: set[str] = set()
    shared: set[str] = set()
    for group in groups:
        paths = {leaf.path for leaf in group.leaves}
        shared |= seen & paths
        seen |= paths
    return frozenset(shared)


def add_group(scene: Scene, group: Group[ResolvedPrim], where: Arrangement, g: int, ctx: Context) -> None:
    """Add a group: its shapes become static if it is placed once, else a prototype."""
    chains = where.world.get(g, [])
    count = sum(map(count_of, chains))
    if count == 0:
        return
    is_once = count == 1 and not rows_of_levels(chains[0]) and not do_move(chains[0])
    once = square(next(chunks(chains[0]))[0]) if is_once else None
    alone = "" if once is None or not ctx.names_instances else name_of(named_levels(chains[0]), 0)
    members: list[Placed] = []
    leaves, group.leaves = group.leaves[::-1], []
    record = ctx.kept.of(Record)
    matrices = _matrices(leaves, record)
    finite: list[bool] = np.asarray(np.isfinite(matrices).all(axis=(1, 2))).tolist()
    placed = matrices if once is None or np.array_equal(once, np.eye(4)) else once @ matrices
    while leaves:  # popped, so that translated leaves are freed
        leaf = leaves.pop()
        scene.has_lights |= leaf.type_name in scene.adapters.lights or leaf.path in ctx.kept.of(LightShapes)
        if not finite.pop():
            ctx.warn("invalid-transform", leaf.path, "Its transform is not finite: it is not rendered.")
        elif leaf.type_name in scene.adapters.lights:
            first = len(scene.lights)
            add_lights(scene, leaf, matrices[len(leaves)], chains, count, group.blur_scale, ctx)
            if g == 0:
                record.note_leaf(Become(leaf, light=first if len(scene.lights) > first else None))
        elif (shape := shape_of(leaf, _standing(leaf, chains, matrices[len(leaves)], ctx), scene)) is not None:
            shape = linked(shape, leaf, scene)
            if g == 0:
                record.note_leaf(Become(leaf, shape=len(scene.shapes)))
            members.append(Placed(len(scene.shapes), placed[len(leaves)], alone))
            scene.shapes.append(shape)
    if once is not None:
        scene.static += members
    elif members:
        scene.number[g] = len(scene.prototypes)
        scene.blur_scales[scene.number[g]] = group.blur_scale
        if g not in where.inside:
            scene.placements += _placements(scene, g, where.top.get(g, []))
        scene.prototypes.append(Prototype(group.path, tuple(members)))


def add_grouped(scene: Scene, groups: list[Group[ResolvedPrim]], where: Arrangement) -> None:
    """Add groups that keep their instances together, as prototypes of placements; their own shapes are one of these."""
    for kept, inside in where.inside.items():
        placements = tuple(p for g, chains in inside.items() if g in scene.number for p in _placements(scene, g, chains))
        if placements:
            top = len(scene.prototypes)
            scene.blur_scales[top] = groups[kept].blur_scale
            scene.prototypes.append(Prototype(groups[kept].path, (), placements))
            scene.placements += [_placement(top, chain) for chain in where.top[kept]]


def _placements(scene: Scene, g: int, chains: list[Chain]) -> list[Placement]:
    return [_placement(scene.number[g], chain) for chain in chains]


def _placement(prototype: int, chain: Chain) -> Placement:
    return Placement(prototype, chain or (MatrixInstances(IDENTITY[None]),), rows_of_levels(chain))


def _standing(leaf: ResolvedPrim, chains: list[Chain], group_from_prim: Doubles, ctx: Context) -> Context:
    """Return the context with the leaf's placements, which decide at how many times moving geometry is sampled."""
    if not ctx.timing.is_open:
        return ctx
    return replace(ctx, stands=Stands(chains, group_from_prim, leaf.inherited.blur_scale, leaf.path not in ctx.shares))


def linked(shape: Shape, leaf: ResolvedPrim, scene: Scene) -> Shape:
    """Return the shape with its row of the light linking table."""
    return shape if scene.links is None else replace(shape, link_row=scene.links.row_of(leaf))


def shape_of(leaf: ResolvedPrim, ctx: Context, scene: Scene) -> Shape | None:
    adapter = scene.adapters.shapes[leaf.type_name]
    try:
        if leaf.path not in ctx.kept.of(LightShapes):
            return adapter(leaf, ctx)
        shape = adapter(without_material(leaf, ctx), ctx)
        return None if shape is None else with_light(shape, leaf, ctx, scene.links)
    except Tf.ErrorException as error:
        ctx.warn("unsupported-prim", leaf.path, f"USD failed to read it: {tf_message(error)}")
        return None


def _matrices(leaves: list[ResolvedPrim], record: Record) -> Doubles:
    """Return group_from_prim (N, 4, 4) of the leaves of a group, whose poses are dropped unless they are recorded."""
    if not leaves:
        return np.zeros((0, 4, 4))
    poses, numbers = leaves[0].poses, [leaf.pose for leaf in leaves]
    return poses.of(numbers) if record.is_on else poses.taken(numbers)
