"""Why the shapes of a stage from which nothing is drawn are not: for the message of an empty picture."""

from __future__ import annotations

from collections import Counter

from pxr import Usd, UsdGeom

from ...settings import RenderSettings
from ..adapters.rendering.render_settings import products
from ..querying.guarded import is_invisible, purpose_of
from ..querying.messages import scene_errors
from ..querying.traversal import drawn_in_instances, everything, stands_in_world


@scene_errors()
def left_out(stage: Usd.Stage, settings: RenderSettings) -> dict[str, int]:
    """How many shapes there are, by the first reason that applies; "" where none does."""
    purposes = settings.purposes or products(stage, settings)[0].purposes
    time = Usd.TimeCode.Default() if settings.time_code is None else Usd.TimeCode(settings.time_code)
    found: Counter[str] = Counter()
    for prim in drawn_in_instances(stage.GetPseudoRoot()):
        if prim.IsA(UsdGeom.Gprim):
            found[_why(prim, purposes, time)] += 1
    if not found:
        absent = [prim for prim in everything(stage) if prim.IsA(UsdGeom.Gprim) and not stands_in_world(prim)]
        found["inactive, or below an abstract prim (class or over) that nothing refers to"] = len(absent)
    return {why: count for why, count in found.most_common() if count}


def _why(prim: Usd.Prim, purposes: tuple[str, ...], time: Usd.TimeCode) -> str:
    purpose = purpose_of(prim)
    if purpose not in purposes:
        return f"of purpose {purpose}, which is not rendered (--purposes)"
    if is_invisible(prim, time):
        return "invisible at this frame"
    return ""
