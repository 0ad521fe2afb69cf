"""UsdGeomPointInstancer: where it puts each prototype, for all its instances at once (UsdGeomPointInstancer,
"Computing an Instance Transform"); the prototype root's own transform is left to the walk."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom

from ...description import Doubles
from ..context import Context
from ..convert import rotations
from ..notes import note_velocities
from ..read import array, read, time_of
from ..resolve import ResolvedPrim


def point_instances(prim: ResolvedPrim, ctx: Context) -> list[tuple[str, Doubles]]:
    """(prototype root path, (K, 3, 4) instancer_from_prototype) for each prototype with visible instances."""
    roots = [str(path) for path in prim.prim.GetRelationship("prototypes").GetForwardedTargets()]
    raw_proto, raw_positions = (read(prim.prim, name, ctx.when) for name in ("protoIndices", "positions"))
    if raw_proto is None or raw_positions is None or len(raw_proto) == 0:
        return []
    proto, positions = array(raw_proto, 1, "i"), array(raw_positions, 3, "f")
    if proto is None or positions is None or len(positions) != len(proto):
        ctx.warn("invalid-instancer", prim.path, "protoIndices and positions are not arrays of the same length.")
        return []
    keep = _shown(prim, roots, proto, positions, ctx)
    matrices = _matrices(prim, positions, ctx)
    bad = keep & ~np.isfinite(matrices).all(axis=(1, 2))
    if bad.any():
        ctx.warn(
            "invalid-transform", prim.path, f"{int(bad.sum())} of {len(proto)} instances have transforms that are not finite."
        )
        keep &= ~bad
    _note_ignored(prim, ctx)
    placed = []
    for k, root in enumerate(roots):
        chosen = keep & (proto == k)
        if chosen.all():
            placed.append((root, matrices))
        elif chosen.any():
            placed.append((root, matrices[chosen]))
    return placed


def _shown(
    prim: ResolvedPrim, roots: list[str], proto: npt.NDArray[Any], positions: npt.NDArray[Any], ctx: Context
) -> npt.NDArray[np.bool_]:
    """Which instances are neither masked nor without a prototype."""
    keep = (proto >= 0) & (proto < len(roots))
    if not keep.all():
        ctx.warn("invalid-instancer", prim.path, f"{int((~keep).sum())} of {len(proto)} protoIndices name no prototype.")
    for k, root in enumerate(roots):
        if not ctx.stage.GetPrimAtPath(root) and (proto == k).any():
            ctx.warn("invalid-instancer", prim.path, f"The prototype {root} does not exist.")
            keep &= proto != k
    if "invisibleIds" in prim.names or prim.prim.HasAuthoredMetadata("inactiveIds"):
        time = time_of(prim.prim.GetAttribute("protoIndices"), ctx.when)
        mask = np.array(UsdGeom.PointInstancer(prim.prim).ComputeMaskAtTime(time), bool)  # empty: all are shown
        if len(mask) == len(keep):
            keep &= mask
        elif len(mask):
            ctx.warn("invalid-instancer", prim.path, "ids does not fit the instances: no instance is hidden by its id.")
    return keep


def _matrices(prim: ResolvedPrim, positions: npt.NDArray[Any], ctx: Context) -> Doubles:
    """(K, 3, 4): translation * rotation * scale, in double."""
    count = len(positions)
    matrices = np.zeros((count, 3, 4))
    quaternions = _per_instance(prim, "orientationsf", 4, count, ctx)
    if quaternions is None:
        quaternions = _per_instance(prim, "orientations", 4, count, ctx)
    matrices[:, :, :3] = np.eye(3) if quaternions is None else rotations(quaternions.astype(np.float64))
    scales = _per_instance(prim, "scales", 3, count, ctx)
    if scales is not None:
        matrices[:, :, :3] *= scales.astype(np.float64)[:, None, :]
    matrices[:, :, 3] = positions
    return matrices


def _per_instance(prim: ResolvedPrim, name: str, columns: int, count: int, ctx: Context) -> npt.NDArray[Any] | None:
    if name not in prim.names:
        return None
    raw = read(prim.prim, name, ctx.when)
    if raw is None or len(raw) == 0:
        return None
    values = array(raw, columns, "f")
    if values is None or len(values) != count:
        ctx.warn("invalid-instancer", prim.path, f"{name} has {len(raw)} values for {count} instances: ignored.")
        return None
    return values


def _note_ignored(prim: ResolvedPrim, ctx: Context) -> None:
    if "primvars:displayColor" in prim.names:
        primvar = UsdGeom.Primvar(prim.prim.GetAttribute("primvars:displayColor"))
        if primvar.GetInterpolation() != UsdGeom.Tokens.constant:
            ctx.warn("instance-primvar", prim.path, "primvars:displayColor varies per instance.")
    note_velocities(prim, "positions", ctx)
