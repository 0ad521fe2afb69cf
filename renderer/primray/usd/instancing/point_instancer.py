"""Adapter for UsdGeomPointInstancer: transforms of all instances of each prototype at once (UsdGeomPointInstancer, "Computing
an Instance Transform"), and their motion over the shutter, as in USD's ComputeInstanceTransformsAtTimes.

The transform of the prototype root itself is applied by the traversal. Where velocities or angular velocities apply, nothing is
interpolated: positions, orientations and scales are those of the sample at or before the frame, advanced by the velocities.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sized
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Sdf

from ...arrays import Doubles, finite_rows
from ...description.placement import Names, PointInstances
from ..motion.attributes import ArrayPath, Rows, bend_times, is_animated
from ..motion.levels import MovingLevel, moving_level
from ..motion.points import extrapolated_positions, may_have_motion, rates_of, report_unused, sample_mismatch
from ..primvars.surface_primvars import instance_primvars
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.metadata import time_codes_per_second
from ..stage.reads import metadatum, targets
from ..stage.values import array, read


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
    keep = _visible_mask(prim, roots, proto, positions, ctx)
    instances = _instances(prim, positions, ctx)
    path = instancer_path(prim, InstanceTransforms(positions, instances.orientations, instances.scales), ctx)
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


def _visible_mask(
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
    return keep & ~_hidden_by_id(prim, len(proto), ctx)


def _hidden_by_id(prim: ResolvedPrim, count: int, ctx: Context) -> npt.NDArray[np.bool_]:
    """Return the mask of instances hidden by their ids, or by their indices where no ids are authored (UsdGeomPointInstancer,
    "Masking Instances").

    USD's own ComputeMaskAtTime is not used: it reads all attributes at one time, while each of these may have time samples
    only, or a default only.
    """
    hidden = _inactive(prim, ctx)
    if "invisibleIds" in prim.names:
        hidden += _id_array(prim, "invisibleIds", ctx).tolist()
    none = np.zeros(count, bool)
    if not hidden:
        return none
    ids = _id_array(prim, "ids", ctx) if "ids" in prim.names else none[:0]
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


def _id_array(prim: ResolvedPrim, name: str, ctx: Context) -> npt.NDArray[Any]:
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
    return PointInstances(
        outer=outer, positions=positions, orientations=quaternions, scales=scales, primvars=primvars, names=names
    )


def _finite(instances: PointInstances) -> npt.NDArray[np.bool_]:
    """Return the mask of instances whose transform is finite."""
    finite = finite_rows(instances.positions)
    finite &= bool(np.isfinite(instances.outer).all())
    for values in (instances.orientations, instances.scales):
        if values is not None:
            finite &= finite_rows(values)
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


ANGULAR = "angularVelocities"


@dataclass(frozen=True, eq=False)
class InstanceTransforms:
    """Positions, orientations and scales of instances at one time."""

    positions: Rows  # (K, 3)
    orientations: Rows | None  # (K, 4): x, y, z, w
    scales: Rows | None  # (K, 3)


@dataclass(frozen=True, eq=False)
class InstancerPath:
    at: Callable[[float], InstanceTransforms]  # offset from the frame -> Parts
    times: tuple[float, ...]  # offsets at which paths may bend


def instancer_path(prim: ResolvedPrim, frame: InstanceTransforms, ctx: Context) -> InstancerPath | None:
    """Return the instances' motion; None if they keep the values `frame`, read at the frame."""
    if not may_have_motion(prim, ctx):
        return None
    paths = {
        name: ArrayPath(prim.prim.GetAttribute(name), columns, ctx.when)
        for name, columns in (("positions", 3), (_name_of_orientations(prim, frame), 4), ("scales", 3))
        if name in prim.names
    }
    by_rates = _path_by_rates(prim, frame, paths, ctx)
    if by_rates is not None or ctx.timing.is_frame:
        return by_rates
    return _sampled_path(prim, frame, paths, ctx)


def _name_of_orientations(prim: ResolvedPrim, frame: InstanceTransforms) -> str:
    """Return the attribute that is used: `orientationsf` if it fits."""
    if frame.orientations is None:
        return ""
    both = {"orientations", "orientationsf"} <= prim.names
    return (
        "orientationsf"
        if "orientationsf" in prim.names and (not both or frame.orientations.dtype == np.float32)
        else "orientations"
    )


def _sampled_path(
    prim: ResolvedPrim, frame: InstanceTransforms, paths: dict[str, ArrayPath], ctx: Context
) -> InstancerPath | None:
    moving = {name: path for name, path in paths.items() if is_animated(path.attribute, ctx.when, ctx.timing)}
    if not moving:
        return None
    times = bend_times([path.attribute for path in moving.values()], ctx.when, ctx.timing)
    first, last = ctx.timing.looked_at
    count = len(frame.positions)
    for name, path in list(moving.items()):
        lengths = {None if rows is None else len(rows) for rows in map(path.at, (first, last, 0.0, *times))}
        if lengths != {count}:
            what = "its instances are" if name == "positions" else f"{name} are"
            message = f"{what} not blurred: the number of {name} changes while the shutter is open."
            ctx.warn("motion", prim.path, message[0].upper() + message[1:], name)
            del moving[name]
            if name == "positions":
                return None
    if not moving:
        return None

    def part(offset: float, name: str, here: Rows | None) -> Rows | None:
        found = moving[name].at(offset) if name in moving else None
        return here if found is None or here is None else found

    orientations = _name_of_orientations(prim, frame)

    def at(offset: float) -> InstanceTransforms:
        positions = part(offset, "positions", frame.positions)
        return InstanceTransforms(
            frame.positions if positions is None else positions,
            part(offset, orientations, frame.orientations),
            part(offset, "scales", frame.scales),
        )

    return InstancerPath(at, tuple(times))


@dataclass(frozen=True, eq=False)
class _Spin:
    """Rotation by angular velocities from the sample at or before the frame."""

    since: float
    per_second: float
    start: Rows
    degrees: Doubles  # (K, 3) per second


def _path_by_rates(
    prim: ResolvedPrim, frame: InstanceTransforms, paths: dict[str, ArrayPath], ctx: Context
) -> InstancerPath | None:
    positions, orientations = paths.get("positions"), paths.get(_name_of_orientations(prim, frame))
    rates = None if positions is None else rates_of(prim, positions, ctx)
    spin = _spin_of(prim, orientations, ctx)
    if (rates is None and spin is None) or positions is None:
        return None
    since = rates.since if rates is not None else spin.since if spin is not None else 0.0
    count = len(frame.positions)
    held = {name: _of_length(path.at(-since), count) for name, path in paths.items()}
    start = held["positions"]
    if start is None or (spin is not None and len(spin.start) != count):
        return None
    turned = None if orientations is None else held[_name_of_orientations(prim, frame)]
    scales = held.get("scales", frame.scales)

    def at(offset: float) -> InstanceTransforms:
        moved = start if rates is None else extrapolated_positions(rates, start, offset)
        return InstanceTransforms(moved, turned if spin is None else _rotated_by_spin(spin, offset), scales)

    return InstancerPath(at, ())


def _of_length(rows: Rows | None, count: int) -> Rows | None:
    return rows if rows is not None and len(rows) == count else None


def _spin_of(prim: ResolvedPrim, orientations: ArrayPath | None, ctx: Context) -> _Spin | None:
    if ANGULAR not in prim.names:
        return None
    path = ArrayPath(prim.prim.GetAttribute(ANGULAR), 3, ctx.when)
    around = None if orientations is None else orientations.bracket()
    problem = "there are no orientations" if orientations is None else sample_mismatch(path, orientations, around)
    if problem or around is None or orientations is None or orientations.frame is None:
        report_unused(problem, ANGULAR, prim, ctx)
        return None
    start, degrees = orientations.sample(around[0]), path.sample(around[0])
    if start is None or degrees is None:
        return None
    return _Spin(orientations.frame - around[0], time_codes_per_second(ctx.stage), start, degrees.astype(np.float64))


def _rotated_by_spin(spin: _Spin, offset: float) -> Doubles:
    """Return orientations (K, 4), turned about the instancer's axes after the authored orientation."""
    seconds = (spin.since + offset) / spin.per_second
    speed = np.linalg.norm(spin.degrees, axis=1)
    half = np.radians(speed) * seconds / 2.0
    axis = spin.degrees / np.where(speed > 0, speed, 1.0)[:, None]
    turn = np.concatenate([axis * np.sin(half)[:, None], np.cos(half)[:, None]], axis=1)
    return _product(turn, spin.start.astype(np.float64))


def _product(a: Doubles, b: Doubles) -> Doubles:
    """Return the product (K, 4) of quaternions x, y, z, w: `b` first, then `a`."""
    va, wa, vb, wb = a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]
    vector = wa * vb + wb * va + np.cross(va, vb)
    return np.concatenate([vector, wa * wb - np.sum(va * vb, axis=1, keepdims=True)], axis=1)
