"""How far the scene reaches: by USD's bounds where these know it, else by what has been translated."""

from __future__ import annotations

from pxr import Usd

from ..querying.traversal import stands_in_world
from ..resolving.context import Context
from ..resolving.resolve import ResolvedPrim
from ..resolving.stage_bounds import Bounds, NotBounded, stage_bounds
from ..viewing.framing import shape_bounds
from ..walking.instances import Arrangement, Group
from .scene import Scene

MAX_BOUNDED_INSTANCES = 1_000_000


def scene_bounds(scene: Scene, groups: list[Group[ResolvedPrim]], where: Arrangement, ctx: Context) -> Bounds:
    is_asked = not (where.cyclic or _is_crowded(groups) or _is_elsewhere(ctx.stage, groups) or ctx.kept.of(NotBounded))
    whole = stage_bounds(ctx.stage, ctx.when, ctx.purposes) if is_asked else None
    return whole or shape_bounds(scene.shapes, scene.static, scene.prototypes, scene.placements)


def _is_elsewhere(stage: Usd.Stage, groups: list[Group[ResolvedPrim]]) -> bool:
    """Whether USD's bounds would leave out what stands in no world: prototypes of point instancers below `class` or `over`."""
    roots = (stage.GetPrimAtPath(group.path) for group in groups[1:] if group.path)
    return any(root and not stands_in_world(root) for root in roots)


def _is_crowded(groups: list[Group[ResolvedPrim]]) -> bool:
    """Whether USD's bounds would make more matrices at once than is good (it does for instancers without an extent)."""
    return sum(len(some) for group in groups for _, some in group.instances) > MAX_BOUNDED_INSTANCES
