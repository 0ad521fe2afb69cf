"""Adapter for UsdGeomPointInstancer: transforms of all instances of each prototype at once (UsdGeomPointInstancer, "Computing
an Instance Transform"). The transform of the prototype root itself is applied by the traversal."""

from __future__ import annotations

from collections.abc import Iterator, Sized
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Sdf

from ....arrays import Doubles
from ....description.instance_names import Names
from ....description.placement import PointInstances
from ...moving.levels import MovingLevel, moving_level
from ...paths.instancers import InstancerPath, Parts, instancer_path
from ...scene.context import Context
from ...scene.inheritance import ResolvedPrim
from ...shapes.instance_primvars import instance_primvars
from ...stage.reads import metadatum, targets
from ...stage.values import array, read


def point_instances(prim: ResolvedPrim, ctx: Context) -> list[tuple[str, PointInstances | MovingLevel]]:
    """Return (prototype root path, instances) for each prototype with visible instances, in the space of the stage or of the
    enclosing prototype.

    All per-instance data is kept in one PointInstances, so that masking applies to all of it.
    """
    roots = [str(path) for path in targets(prim.prim, "prototypes")]
    raw_proto, raw_positions = (read(prim.prim, name, ctx.when) for name in ("protoIndices", "positions"))
    missing = [_is_empty(raw_proto), _is_empty(raw_positions)]
    if any(missing):
        if not all(missing):
            there, absent = ("positions", "protoIndices") if missing[0] else ("protoIndices", "positions")
            ctx.warn(
                "invalid-instancer", prim.path, f"It has {there} but no {absent}: none of its instances can be placed.", absent
            )
        return []
    proto, positions = array(raw_proto, 1, "i"), array(raw_positions, 3, "f")
    if proto is None or positions is None or len(positions) != len(proto):
        ctx.warn(
            "invalid-instancer", prim.path, "protoIndices and positions are not arrays of the same length.", "protoIndices"
        )
        return []
    keep = _shown(prim, roots, proto, positions, ctx)
    instances = _instances(prim, positions, ctx)
    path = instancer_path(prim, Parts(positions, instances.orientations, instances.scales), ctx)
    if path is not None:
        here = path.at(0.0)
        instances = replace(instances, positions=here.positions, orientations=here.orientations, scales=here.scales)
    bad = keep & ~_finite(instances)
    if bad.any():
        ctx.warn(
            "invalid-transform",
            prim.path,
            f"{int(bad.sum())} of {len(proto)} instances are not rendered: their transforms are not finite.",
        )
        keep &= ~bad
    moving = instances if path is None or ctx.timing.is_frame else _moving(instances, path)
    return [(roots[k], chosen) for k, chosen in _by_prototype(moving, proto, keep, len(roots))]


def _moving(frame: PointInstances, path: InstancerPath) -> MovingLevel:
    def rows_at(offset: float) -> Doubles:
        then = path.at(offset)
        moved = replace(frame, positions=then.positions, orientations=then.orientations, scales=then.scales)
        return moved.rows(0, len(moved))

    return moving_level(rows_at, path.times, frame)


def _is_empty(raw: Any) -> bool:
    return raw is None or (isinstance(raw, Sized) and len(raw) == 0)


def _by_prototype(
    instances: PointInstances | MovingLevel, proto: npt.NDArray[Any], keep: npt.NDArray[np.bool_], roots: int
) -> Iterator[tuple[int, PointInstances | MovingLevel]]:
    """Yield the visible instances of each prototype that has any, in their authored order."""
    shown = np.flatnonzero(keep) if not keep.all() else None
    kept = proto if shown is None else proto[shown]
    counts = np.bincount(kept, minlength=roots)
    if np.count_nonzero(counts) == 1 and shown is None:
        yield int(kept[0]), instances
        return
    # With few prototypes their indices fit 16 bits, which numpy sorts in linear time.
    order = np.argsort(kept.astype(np.uint16 if roots <= 1 << 16 else np.int32), kind="stable")
    ends = np.cumsum(counts)
    for k in np.flatnonzero(counts):
        chosen = order[ends[k] - counts[k] : ends[k]]
        yield int(k), instances.take(chosen if shown is None else shown[chosen])


def _shown(
    prim: ResolvedPrim, roots: list[str], proto: npt.NDArray[Any], positions: npt.NDArray[Any], ctx: Context
) -> npt.NDArray[np.bool_]:
    """Return the mask of instances that have a prototype and are not hidden by id."""
    keep = (proto >= 0) & (proto < len(roots))
    if not keep.all():
        ctx.warn(
            "invalid-instancer",
            prim.path,
            f"{int((~keep).sum())} of {len(proto)} protoIndices name no prototype: these instances are not rendered.",
            "protoIndices",
        )
    for k, root in enumerate(roots):
        if not ctx.stage.GetPrimAtPath(root) and (proto == k).any():
            ctx.warn(
                "invalid-instancer",
                prim.path,
                f"The prototype {root} does not exist: its instances are not rendered.",
                "prototypes",
            )
            keep &= proto != k
    return keep & ~_masked(prim, len(proto), ctx)


def _masked(prim: ResolvedPrim, count: int, ctx: Context) -> npt.NDArray[np.bool_]:
    """Return the mask of instances hidden by their ids, or by their indices where no ids are authored (UsdGeomPointInstancer,
    "Masking Instances").

    USD's own ComputeMaskAtTime is not used: it reads all attributes at one time, while each of these may have time samples
    only, or a default only.
    """
    hidden = _inactive(prim, ctx)
    if "invisibleIds" in prim.names:
        hidden += _ids(prim, "invisibleIds", ctx).tolist()
    none = np.zeros(count, bool)
    if not hidden:
        return none
    ids = _ids(prim, "ids", ctx) if "ids" in prim.names else none[:0]
    if len(ids) not in (0, count):
        ctx.warn("invalid-instancer", prim.path, "ids does not fit the instances: no instance is hidden by its id.", "ids")
        return none
    return np.isin(ids if len(ids) else np.arange(count), hidden)


def _inactive(prim: ResolvedPrim, ctx: Context) -> list[int]:
    if not prim.prim.HasAuthoredMetadata("inactiveIds"):
        return []
    listed = metadatum(prim.prim, "inactiveIds")
    if isinstance(listed, Sdf.Int64ListOp):
        return list(listed.GetAppliedItems())
    if listed is not None:
        ctx.warn("wrong-type", prim.path, "inactiveIds is not a list of integers: ignored.", "inactiveIds")
    return []


def _ids(prim: ResolvedPrim, name: str, ctx: Context) -> npt.NDArray[Any]:
    raw = read(prim.prim, name, ctx.when)
    found = None if raw is None else array(raw, 1, "i")
    if found is None and raw is not None:
        ctx.warn("wrong-type", prim.path, f"{name} is not an array of integers: ignored.", name)
    return np.zeros(0, np.int64) if found is None else found


def _instances(prim: ResolvedPrim, positions: npt.NDArray[Any], ctx: Context) -> PointInstances:
    count = len(positions)
    quaternions = _per_instance(prim, "orientationsf", 4, count, ctx)
    if quaternions is None:
        quaternions = _per_instance(prim, "orientations", 4, count, ctx)
    scales = _per_instance(prim, "scales", 3, count, ctx)
    names = Names(prim.path, numbers=np.arange(count, dtype=np.int32)) if ctx.names_instances else None
    outer, primvars = prim.group_from_prim[:3], instance_primvars(prim, count, ctx)
    return PointInstances(outer, positions, quaternions, scales, primvars, names)


def _finite(instances: PointInstances) -> npt.NDArray[np.bool_]:
    """Return the mask of instances whose transform is finite."""
    finite = np.asarray(np.isfinite(instances.positions).all(axis=1))
    finite &= bool(np.isfinite(instances.outer).all())
    for values in (instances.orientations, instances.scales):
        if values is not None:
            finite &= np.isfinite(values).all(axis=1)
    return finite


def _per_instance(prim: ResolvedPrim, name: str, columns: int, count: int, ctx: Context) -> npt.NDArray[Any] | None:
    if name not in prim.names:
        return None
    raw = read(prim.prim, name, ctx.when)
    if _is_empty(raw):
        return None
    values = array(raw, columns, "f")
    if values is None or len(values) != count:
        ctx.warn("invalid-instancer", prim.path, f"{name} {_size(raw)} for {count} instances: ignored.", name)
        return None
    return values


def _size(raw: Any) -> str:
    return f"has {len(raw)} values" if isinstance(raw, Sized) else "is not an array"
