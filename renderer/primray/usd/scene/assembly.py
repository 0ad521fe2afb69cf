"""Assembly of a scene: groups of the walk become static shapes or prototypes with placements; then its bounds, times and
description."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from pxr import Tf, Usd

from ...aovs import WIDE
from ...arrays import Doubles
from ...description import Camera, CameraMotion, MotionSteps, Placed, Placement, Prototype, Shape
from ...description.placement import IDENTITY, MatrixInstances, chunks, instance_name, named_levels, rows_of_levels
from ..camera.framed_objects import prototype_box, shape_bounds
from ..instancing.instances import Arrangement, Chain, Group, count_of
from ..lights.assembly import add_lights
from ..lights.geometry_light import with_light, without_material
from ..lights.motion import with_motion, with_moving_portals
from ..motion.levels import ShapePlacements, any_moves
from ..motion.matrices import MotionPrecision, with_sampled_motion
from ..motion.timing import pixels_of
from ..stage.messages import tf_message
from ..stage.traversal import is_in_world
from ..stage.values import square
from .bounds import Bounds, stage_bounds
from .context import Context
from .inheritance import ResolvedPrim
from .translated_scene import Record, TranslatedLeaf, TranslatedScene

VOLUME = "Volume"  # the prim type of volumes, whose adapter is imported where a stage has one


def shared_paths(groups: list[Group[ResolvedPrim]]) -> frozenset[str]:
    """Return the paths of prims that several groups contain, because their instances hand down different states."""
    seen: set[str] = set()
    shared: set[str] = set()
    for group in groups:
        paths = {leaf.path for leaf in group.leaves}
        shared |= seen & paths
        seen |= paths
    return frozenset(shared)


def add_group(scene: TranslatedScene, group: Group[ResolvedPrim], where: Arrangement, g: int, ctx: Context) -> None:
    """Add a group: its shapes become static if it is placed once, else a prototype."""
    chains = where.world.get(g, [])
    count = sum(map(count_of, chains))
    if count == 0:
        return
    is_once = count == 1 and not rows_of_levels(chains[0]) and not any_moves(chains[0])
    once = square(next(chunks(chains[0]))[0]) if is_once else None
    alone = "" if once is None or not ctx.names_instances else instance_name(named_levels(chains[0]), 0)
    members: list[Placed] = []
    leaves, group.leaves = group.leaves[::-1], []
    record = scene.record
    matrices = _matrices(leaves, record)
    finite: list[bool] = np.asarray(np.isfinite(matrices).all(axis=(1, 2))).tolist()
    placed = matrices if once is None or np.array_equal(once, np.eye(4)) else once @ matrices
    while leaves:  # popped, so that translated leaves are freed
        leaf = leaves.pop()
        scene.has_lights |= leaf.type_name in scene.adapters.lights or leaf.path in ctx.findings.light_shapes
        if not finite.pop():
            ctx.warn("invalid-transform", leaf.path, "Its transform is not finite: it is not rendered.")
        elif leaf.type_name in scene.adapters.lights:
            first = len(scene.lights)
            add_lights(scene, leaf, matrices[len(leaves)], chains, count, group.blur_scale, ctx)
            if g == 0:
                record.note_leaf(TranslatedLeaf(leaf, light=first if len(scene.lights) > first else None))
        elif leaf.type_name == VOLUME:
            from ..volumes.volume import add_volume

            add_volume(scene, leaf, matrices[len(leaves)], chains, g == 0, ctx)
        elif (shape := shape_of(leaf, _with_placements(leaf, chains, matrices[len(leaves)], ctx), scene)) is not None:
            shape = linked(shape, leaf, scene)
            if g == 0:
                record.note_leaf(TranslatedLeaf(leaf, shape=len(scene.shapes)))
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


def add_kept_groups(scene: TranslatedScene, groups: list[Group[ResolvedPrim]], where: Arrangement) -> None:
    """Add groups that keep their instances together, as prototypes of placements; their own shapes are one of these."""
    for kept, inside in where.inside.items():
        placements = tuple(p for g, chains in inside.items() if g in scene.number for p in _placements(scene, g, chains))
        if placements:
            top = len(scene.prototypes)
            scene.blur_scales[top] = groups[kept].blur_scale
            scene.prototypes.append(Prototype(groups[kept].path, (), placements))
            scene.placements += [_placement(top, chain) for chain in where.top[kept]]


def _placements(scene: TranslatedScene, g: int, chains: list[Chain]) -> list[Placement]:
    return [_placement(scene.number[g], chain) for chain in chains]


def _placement(prototype: int, chain: Chain) -> Placement:
    return Placement(prototype, chain or (MatrixInstances(IDENTITY[None]),), rows_of_levels(chain))


def _with_placements(leaf: ResolvedPrim, chains: list[Chain], group_from_prim: Doubles, ctx: Context) -> Context:
    """Return the context with the leaf's placements, which decide at how many times moving geometry is sampled."""
    if not ctx.timing.is_open:
        return ctx
    return replace(ctx, stands=ShapePlacements(chains, group_from_prim, leaf.inherited.blur_scale, leaf.path not in ctx.shares))


def linked(shape: Shape, leaf: ResolvedPrim, scene: TranslatedScene) -> Shape:
    """Return the shape with its row of the light linking table."""
    return shape if scene.links is None else replace(shape, link_row=scene.links.row_of(leaf))


def shape_of(leaf: ResolvedPrim, ctx: Context, scene: TranslatedScene) -> Shape | None:
    adapter = scene.adapters.shapes[leaf.type_name]
    try:
        if leaf.path not in ctx.findings.light_shapes:
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


MAX_BOUNDED_INSTANCES = 1_000_000


def scene_bounds(scene: TranslatedScene, groups: list[Group[ResolvedPrim]], where: Arrangement, ctx: Context) -> Bounds:
    is_asked = not (where.cyclic or _is_crowded(groups) or _is_elsewhere(ctx.stage, groups) or ctx.findings.unbounded_shapes)
    whole = stage_bounds(ctx.stage, ctx.when, ctx.purposes) if is_asked else None
    return whole or shape_bounds(scene.shapes, scene.static, scene.prototypes, scene.placements, scene.volumes)


def _is_elsewhere(stage: Usd.Stage, groups: list[Group[ResolvedPrim]]) -> bool:
    """Return whether USD's bounds would omit prims that are not in the world: instancers' prototypes below `class` or
    `over`."""
    roots = (stage.GetPrimAtPath(group.path) for group in groups[1:] if group.path)
    return any(root and not is_in_world(root) for root in roots)


def _is_crowded(groups: list[Group[ResolvedPrim]]) -> bool:
    """Return whether USD's bounds would compute too many matrices at once (it does for instancers without an extent)."""
    return sum(len(some) for group in groups for _, some in group.instances) > MAX_BOUNDED_INSTANCES


def choose_times(
    scene: TranslatedScene, ctx: Context, camera: Camera, motion: CameraMotion | None, resolution: tuple[int, int]
) -> list[MotionSteps]:
    """Choose the times of everything that moves, and return the steps of each."""
    cameras = (camera, *(motion.cameras if motion else ()))
    precision = MotionPrecision(ctx.timing, pixels_of(cameras, resolution), ctx.settings.most_motion_error)

    def at_seam(placement: Placement) -> Placement:
        number = placement.prototype
        box = (
            prototype_box(scene.shapes, scene.prototypes, number) if any_moves(placement.levels) else (np.zeros(3), np.zeros(3))
        )
        return with_sampled_motion(placement, scene.blur_scales[number], box, scene.prototypes[number].path, precision)

    scene.placements = [at_seam(placement) for placement in scene.placements]
    for number, path in scene.moving_lights:
        scene.lights[number] = with_motion(scene.lights[number], path, precision, ctx)
    for volume_path in scene.volume_paths:
        volume_path.sample(scene.media, scene.volume_emissions, precision)
    for k, prototype in enumerate(scene.prototypes):
        if prototype.placements:
            scene.prototypes[k] = replace(prototype, placements=tuple(map(at_seam, prototype.placements)))
    if motion is not None or scene.moves:  # motion of portals alone does not show in a picture
        paths = dict(scene.moving_lights)
        for number, made in enumerate(scene.lights):
            if made.portals:
                scene.lights[number] = with_moving_portals(made, paths.get(number), precision, ctx)
    return precision.steps


def note_errors(steps: list[MotionSteps], ctx: Context) -> None:
    """Report motion that would have needed more times than are allowed."""
    for found in steps:
        if found.error > ctx.settings.most_motion_error:
            pixels = f"{found.error:.2g}" if math.isfinite(found.error) else "any number of"
            left = f"its path is sampled in {found.segments} steps, which leaves an error of up to {pixels} pixels."
            ctx.warn("motion", ctx.shown(found.path), f"It moves fast: {left}")


def note_missing_primvars(scene: TranslatedScene, ctx: Context) -> None:
    there = {p.name.removeprefix(WIDE) for owner in (*scene.shapes, *scene.placements) for p in owner.primvars}
    for name in ctx.aov_primvars:
        if name not in there:
            ctx.warn("aov-empty", "", f"Nothing in the picture has primvars:{name}: its AOV is 0 everywhere.")
