"""Leaves that a change of transforms moves, and their new matrices."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...arrays import Doubles
from ..querying.guarded import property_names
from ..resolving.context import Context
from ..resolving.resolve import local_matrix, transforms
from ..walking.record import Become, Record
from .not_known import NotKnownError


def moved_leaves(paths: Iterable[str], record: Record, ctx: Context) -> list[tuple[Become, Doubles]]:
    """Return leaves whose matrices (4, 4) have changed, with the new ones; the record's poses are updated."""
    paths = list(paths)
    if not paths or not record.poses:
        return []
    poses = next(iter(record.poses.values()))[0]
    if any(other is not poses for other, _ in (*record.poses.values(), *record.used)):
        raise NotKnownError
    before = poses.every().copy()
    cache = transforms(ctx.when)
    for path in paths:
        if path not in record.poses:
            raise NotKnownError
        prim = ctx.stage.GetPrimAtPath(path)
        local, _ = local_matrix(prim, frozenset(property_names(prim)), ctx.when, cache)
        poses.put(record.poses[path][1], local)
    after = poses.every()
    if not np.isfinite(after).all() or not np.isfinite(before).all():
        raise NotKnownError
    is_moved = (before.view(np.uint64) != after.view(np.uint64)).any(axis=(1, 2))
    if any(is_moved[pose] for _, pose in record.used):
        raise NotKnownError
    found = [become for become in record.leaves.values() if is_moved[become.leaf.pose]]
    return list(zip(found, poses.of([become.leaf.pose for become in found]), strict=True)) if found else []
