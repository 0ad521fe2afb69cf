# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur: stages of the frame and of the shutter's instants, merged by path into time samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

Note = Callable[[str, str, str], None]
NAME = "userProperties:blender:object_name"
LENS = ("focalLength", "focusDistance", "fStop", "horizontalAperture", "verticalAperture", "horizontalApertureOffset",
        "verticalApertureOffset")  # fmt: skip
POINTS = ("points", "normals", "widths")
INSTANCES = ("positions", "orientations", "orientationsf", "scales")


def shutter_of(scene: Any) -> tuple[float, float] | None:
    """Return the frames at which the shutter opens and closes, relative to the scene's; None without motion blur."""
    render = scene.render
    if not render.use_motion_blur or render.motion_blur_shutter <= 0:
        return None
    length = render.motion_blur_shutter
    begin = {"START": 0.0, "END": -length}.get(render.motion_blur_position, -length / 2)
    return begin, begin + length


def instants(shutter: tuple[float, float]) -> list[float]:
    """Return the frames, relative to the scene's, at which the shutter opens, is half open, and closes, without the scene's."""
    return [at for at in (shutter[0], sum(shutter) / 2, shutter[1]) if abs(at) > 1e-6]


def merge(stage: Usd.Stage, frame: float, others: list[tuple[float, Usd.Stage]], still: set[str], note: Note) -> None:
    """Author time samples of what differs at other frames; objects named in `still` are not blurred."""
    for prim in list(stage.Traverse()):
        owner = _owner(prim)
        if owner in still:
            continue
        twins = [(at, other.GetPrimAtPath(prim.GetPath())) for at, other in others]
        if any(not twin or twin.GetTypeName() != prim.GetTypeName() for _, twin in twins):
            if prim.IsA(UsdGeom.Gprim):
                note(
                    "motion-topology", owner or prim.GetName(), "it is not there all the time that the shutter is open: no blur"
                )
            continue
        names = [name for name in prim.GetPropertyNames() if name.startswith("xformOp:")]
        if prim.IsA(UsdGeom.Camera):
            names += LENS
        elif prim.IsA(UsdGeom.PointInstancer):
            if _alike(prim, twins, ("ids", "protoIndices"), owner, note):
                names += INSTANCES
        elif prim.IsA(UsdGeom.PointBased) and _alike(
            prim, twins, ("faceVertexCounts", "faceVertexIndices", "curveVertexCounts"), owner, note
        ):
            names += POINTS
        for name in names:
            _sample(prim, name, frame, twins)


def _owner(prim: Usd.Prim) -> str:
    """Return the name of the object that a prim was exported from, or ""."""
    while prim:
        found = prim.GetAttribute(NAME)
        if found and found.Get():
            return str(found.Get())
        if prim.GetMetadata("displayName"):
            return str(prim.GetMetadata("displayName"))
        prim = prim.GetParent()
    return ""


def _alike(prim: Usd.Prim, twins: list[tuple[float, Usd.Prim]], names: tuple[str, ...], owner: str, note: Note) -> bool:
    """Return whether attributes are the same at all frames; notes it where they are not."""
    for name in names:
        value = prim.GetAttribute(name).Get() if prim.HasAttribute(name) else None
        if any((twin.GetAttribute(name).Get() if twin.HasAttribute(name) else None) != value for _, twin in twins):
            note("motion-topology", owner, "its faces, curves or instances change while the shutter is open: they do not blur")
            return False
    return True


def _sample(prim: Usd.Prim, name: str, frame: float, twins: list[tuple[float, Usd.Prim]]) -> None:
    attribute = prim.GetAttribute(name)
    value = attribute.Get() if attribute else None
    if value is None:
        return
    values = [(at, twin.GetAttribute(name).Get() if twin.HasAttribute(name) else None) for at, twin in twins]
    if any(other is None or _length(other) != _length(value) for _, other in values):
        return
    if all(_close(other, value) for _, other in values):
        return
    for at, other in [(frame, value), *values]:
        attribute.Set(other, at)


def _length(value: Any) -> int:
    return len(value) if hasattr(value, "__len__") else 1


def _close(a: Any, b: Any) -> bool:
    try:
        one, other = np.asarray(a, np.float64), np.asarray(b, np.float64)
    except (TypeError, ValueError):
        return bool(a == b)
    return bool((np.abs(one - other) <= 1e-7 * (1 + np.abs(other))).all())
