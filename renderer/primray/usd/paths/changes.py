"""Detection of attributes that change around the shutter, the times at which their paths bend, and local transforms at any
time."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Usd, UsdGeom

from ...arrays import Doubles
from ..moving.mover import Local
from ..moving.timing import Timing
from ..stage.reads import local_transform_at
from ..stage.time_varying import might_vary, number_of, scalar_operations, times_between, varies
from ..stage.values import When, matrix, time_of


def moving_operations(prim: Usd.Prim, names: frozenset[str], when: When, timing: Timing) -> list[Usd.Attribute]:
    """Return the transform ops that change around the shutter."""
    if timing.is_frame:
        return []
    asked = [name for name in names if name.startswith("xformOp:")] if timing.is_timed else scalar_operations(names)
    attributes = map(prim.GetAttribute, asked)
    return [attribute for attribute in attributes if moves(attribute, when, timing)]


def moves(attribute: Usd.Attribute, when: When, timing: Timing) -> bool:
    """Return whether the attribute's value changes around the shutter."""
    if not attribute or not might_vary(attribute):
        return False
    frame = number_of(time_of(attribute, when), attribute)
    first, last = timing.looked_at
    return frame is not None and varies(attribute, frame + first, frame + last)


def bends(attributes: Iterable[Usd.Attribute], when: When, timing: Timing) -> list[float]:
    """Return the offsets from the frame, around the shutter, at which the path of any of the attributes may bend."""
    first, last = timing.looked_at
    found: set[float] = set()
    for attribute in attributes:
        frame = number_of(time_of(attribute, when), attribute)
        if frame is not None:
            found.update(time - frame for time in times_between(attribute, frame + first, frame + last))
    return sorted(found)


def transform_of(prim: Usd.Prim, when: When) -> Local:
    """Return the prim's local transform as a function of the offset from the frame."""

    def local(offset: float) -> Doubles:
        then = when.after(offset)
        return matrix(local_transform_at(prim, lambda attribute: time_of(attribute, then))[0])

    return local


def blur_scale_of(prim: Usd.Prim) -> float:
    """Return motion:blurScale (UsdGeomMotionAPI) of the prim or its nearest ancestor that has it."""
    api = UsdGeom.MotionAPI(prim)
    return max(float(api.ComputeMotionBlurScale()), 0.0) if api else 1.0
