"""Bounds of the scene: USD's where it knows them, else those of the translated shapes."""

from __future__ import annotations

from pxr import Usd

from ..querying.traversal import stands_in_world
from ..resolving.context import Context
from ..resolving.resolve import ResolvedPrim
from ..resolving.stage_bounds import Bounds, NotBounded, stage_bounds
from ..viewing.drawn import shape_bounds
from ..walking.instances import Arrangement, Group
from .scene import Scene

MAX_BOUNDED_INSTANCES = 1_000_000


def scene_bounds(scene: Scene, groups: list[Group[ResolvedPrim]], where: Arrangement, ctx: Context) -> Bounds:
    is_asked = not (where.cyclic or _is_crowded(groups) or _is_elsewhere(ctx.stage, groups) or ctx.kept.of(NotBounded))
    whole = stage_bounds(ctx.stage, ctx.when, ctx.purposes) if is_asked else None
    return whole or shape_bounds(scene.shapes, scene.static, scene.prototypes, scene.placements)


def _is_elsewhere(stage: Usd.Stage, groups: list[Group[ResolvedPrim]]) -> bool:
    """Return whether USD's bounds would omit prims that are not in the world: instancers' prototypes below `class` or
    `over`."""
    roots = (stage.GetPrimAtPath(group.path) for group in groups[1:] if group.path)
    return any(root and not stands_in_world(root) for root in roots)


def _is_crowded(groups: list[Group[ResolvedPrim]]) -> bool:
    """Return whether USD's bounds would compute too many matrices at once (it does for instancers without an extent)."""
    return sum(len(some) for group in groups for _, some in group.instances) > MAX_BOUNDED_INSTANCES
