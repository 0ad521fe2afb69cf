"""The bounding box of a stage as USD computes it, where that is possible."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pxr import Tf, Usd, UsdGeom

from ...arrays import Doubles
from ..stage.time_varying import EARLIEST
from ..stage.traversal import all_prims
from ..stage.values import When

Bounds = tuple[Doubles, Doubles]  # centre and size of the world's axis-aligned box


# UsdGeomBBoxCache (26.11) recurses: it survives 1000 levels and overflows the stack at 2000.
DEEPEST = 500


def stage_bounds(stage: Usd.Stage, when: When, purposes: tuple[str, ...]) -> Bounds | None:
    """Return the stage's bounds as usdrecord does, authored extents included; None where USD cannot tell, or is not finite.

    They are also unknown where splines were read at their first knots: USD's earliest time is before these. Not to be called
    where an instancer contains itself: UsdGeomBBoxCache (26.11) then overflows the stack.
    """
    if when.at_knots or is_deep(all_prims(stage)):
        return None
    time = EARLIEST if when.careful else when.time
    try:
        box = UsdGeom.BBoxCache(time, list(purposes), useExtentsHint=True).ComputeWorldBound(stage.GetPseudoRoot())
    except Tf.ErrorException:  # something on the stage is of the wrong type; its own reader says what
        return None
    aligned = box.ComputeAlignedRange()
    if aligned.IsEmpty():
        return None
    center, size = np.array(box.ComputeCentroid()), np.array(aligned.GetSize())
    return (center, size) if np.isfinite(center).all() and np.isfinite(size).all() else None


def is_deep(prims: Iterable[Usd.Prim]) -> bool:
    """Return whether prims are too deep for UsdGeomBBoxCache."""
    return any(prim.GetPath().pathElementCount > DEEPEST for prim in prims)


def world_box(stage: Usd.Stage, path: str, time_code: float | None) -> tuple[Doubles, Doubles] | None:
    """Return the low and high corner (3,) of a prim in the world, as USD computes its bounds; None where it has none.

    The earliest time stands for no time code.
    """
    prim = stage.GetPrimAtPath(path)
    if not prim or is_deep(all_prims(stage)):
        return None
    time = EARLIEST if time_code is None else Usd.TimeCode(time_code)
    try:
        box = UsdGeom.BBoxCache(time, ["default", "render", "proxy"]).ComputeWorldBound(prim).ComputeAlignedRange()
    except Tf.ErrorException:
        return None
    low, high = np.array(box.GetMin()), np.array(box.GetMax())
    return None if box.IsEmpty() or not np.isfinite([low, high]).all() else (low, high)
