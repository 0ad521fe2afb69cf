"""Everything that a pose depends on, held where it is at the times of the poses: baking visits authored samples only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from pxr import Sdf, Usd

from ..querying.guarded import authored_attributes
from ..querying.time_varying import has_times
from ..querying.traversal import there_below
from ..resolving.read import When, value
from .pose_times import PoseTimes
from .skeleton_bindings import SkeletonBinding

if TYPE_CHECKING:
    from pxr import UsdSkel  # imported where a stage has skeletons: it takes as long as Python itself

BAKED = ("points", "normals", "extent", "xformOp:transform")  # the latter of what one joint moves as a whole


def hold(root: Usd.Prim, bindings: list[SkeletonBinding], layer: Sdf.Layer, when: When, times: PoseTimes | None) -> None:
    """In this layer, the stage's edit target: what moves the poses at all their times, the rest as it is at the frame."""
    for prim in _involved(root, bindings):
        for attribute in authored_attributes(prim):
            if layer.GetNumTimeSamplesForPath(attribute.GetPath()):  # of another root's times
                attribute.Clear()
            if has_times(attribute):
                _hold(attribute, when, times)
    if times is not None:
        for query in (query for binding in bindings for query in binding.targets):
            _hold_binding(query, when, times)


def _hold_binding(query: UsdSkel.SkinningQuery, when: When, times: PoseTimes) -> None:
    """The same one at all times: baking does not ask whether transforms of skeletons and meshes have samples."""
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
    """Of a pose; at the default time the first one is at the frame."""
    return Usd.TimeCode(offset if when.is_default else when.number + offset)


def leave_to_samples(layer: Sdf.Layer, bindings: list[SkeletonBinding]) -> None:
    """At the default time they are read at their first sample, unless a default is found, as what is authored below has."""
    for binding in bindings:
        for query in binding.targets:
            for name in BAKED:
                spec = layer.GetAttributeAtPath(query.GetPrim().GetPath().AppendProperty(name))
                if spec and layer.GetNumTimeSamplesForPath(spec.path):
                    spec.default = Sdf.ValueBlock()


def _involved(root: Usd.Prim, bindings: list[SkeletonBinding]) -> Iterator[Usd.Prim]:
    """Everything that the pose depends on: what stands above and below the root, skeletons and animations."""
    yield from _above(root)
    yield from there_below(root)
    for binding in bindings:
        if not binding.skeleton.GetPath().HasPrefix(root.GetPath()):
            yield binding.skeleton
            yield from _above(binding.skeleton)
        if binding.animation:
            yield binding.animation


def _above(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    while (prim := prim.GetParent()) and not prim.IsPseudoRoot():
        yield prim
