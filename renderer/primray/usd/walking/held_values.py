"""Authoring of everything a pose depends on at the times of the poses, since USD's baking visits authored samples only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from pxr import Sdf, Usd

from ..stage.reads import authored_attributes
from ..stage.time_varying import has_times
from ..stage.traversal import find_below
from ..stage.values import When, value
from .pose_times import PoseTimes
from .skeleton_bindings import SkeletonBinding

if TYPE_CHECKING:
    from pxr import UsdSkel  # imported only for stages with skeletons: it takes as long as starting Python

BAKED = ("points", "normals", "extent", "xformOp:transform")  # the last for shapes that one joint moves rigidly


def hold(root: Usd.Prim, bindings: list[SkeletonBinding], layer: Sdf.Layer, when: When, times: PoseTimes | None) -> None:
    """Author, in this layer (the stage's edit target), samples at all pose times for attributes that move poses, and the value
    at the frame for the others."""
    for prim in _involved(root, bindings):
        for attribute in authored_attributes(prim):
            if layer.GetNumTimeSamplesForPath(attribute.GetPath()):  # samples for another root's times
                attribute.Clear()
            if has_times(attribute):
                _hold(attribute, when, times)
    if times is not None:
        for query in (query for binding in bindings for query in binding.targets):
            _hold_binding(query, when, times)


def _hold_binding(query: UsdSkel.SkinningQuery, when: When, times: PoseTimes) -> None:
    """Author the geom bind transform at all pose times: baking does not check whether transforms of skeletons and meshes have
    samples."""
    from pxr import UsdSkel

    if not query.HasJointInfluences() or query.GetPrim().IsInstanceProxy():
        return
    present = query.GetGeomBindTransform(when.time)
    attribute = UsdSkel.BindingAPI(query.GetPrim()).CreateGeomBindTransformAttr(present)
    for offset in times.offsets:
        attribute.Set(present, time_code(when, offset))


def _hold(attribute: Usd.Attribute, when: When, times: PoseTimes | None) -> None:
    present = value(attribute, when)
    if present is None:
        return
    if times is None or str(attribute.GetPath()) not in times.moving:
        attribute.Set(present)
        return
    found = [(time_code(when, offset), value(attribute, when.after(offset))) for offset in times.offsets]
    attribute.Set(present)
    for time, then in found:
        if then is not None:
            attribute.Set(then, time)


def time_code(when: When, offset: float) -> Usd.TimeCode:
    """Return the time code of a pose; with the default time the first sample is at the frame."""
    return Usd.TimeCode(offset if when.is_default else when.number + offset)


def leave_to_samples(layer: Sdf.Layer, bindings: list[SkeletonBinding]) -> None:
    """Block the defaults of baked attributes with samples: at the default time they are read at their first sample only if no
    default is found, not even a weaker one."""
    for binding in bindings:
        for query in binding.targets:
            for name in BAKED:
                spec = layer.GetAttributeAtPath(query.GetPrim().GetPath().AppendProperty(name))
                if spec and layer.GetNumTimeSamplesForPath(spec.path):
                    spec.default = Sdf.ValueBlock()


def _involved(root: Usd.Prim, bindings: list[SkeletonBinding]) -> Iterator[Usd.Prim]:
    """Yield every prim that the pose depends on: the root with its ancestors and descendants, skeletons and animations."""
    yield from _above(root)
    yield from find_below(root)
    for binding in bindings:
        if not binding.skeleton.GetPath().HasPrefix(root.GetPath()):
            yield binding.skeleton
            yield from _above(binding.skeleton)
        if binding.animation:
            yield binding.animation


def _above(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    while (prim := prim.GetParent()) and not prim.IsPseudoRoot():
        yield prim
