"""Primvars of a mesh brought to triangles: indexed values, and the interpolations that a description knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from ..description import Floats
from .context import Context
from .read import array, value
from .resolve import ResolvedPrim
from .triangulate import Triangles


@dataclass(frozen=True)
class Primvar:
    """`values` (M, columns), indices applied; `interpolation` is USD's token."""

    values: Floats
    interpolation: str


@dataclass(frozen=True)
class Sizes:
    """How many values each interpolation needs on one mesh."""

    faces: int
    points: int
    corners: int

    def of(self, interpolation: str) -> int:
        return {"constant": 1, "uniform": self.faces, "vertex": self.points, "varying": self.points}.get(
            interpolation, self.corners
        )


def read_primvar(attribute: Usd.Attribute, sizes: Sizes, prim: ResolvedPrim, ctx: Context) -> Primvar | None:
    """A primvar of three columns, checked against the mesh; None, noted, when it does not fit; None if it has no value."""
    primvar = UsdGeom.Primvar(attribute)
    raw = value(attribute, ctx.when)
    if raw is None:
        return None
    indices = value(primvar.GetIndicesAttr(), ctx.when) if primvar.IsIndexed() else None
    return check_values(raw, indices, primvar.GetInterpolation(), attribute.GetName(), sizes, prim, ctx)


def check_values(
    raw: object, raw_indices: object, interpolation: str, name: str, sizes: Sizes, prim: ResolvedPrim, ctx: Context
) -> Primvar | None:
    values = array(raw, 3, "f")
    if values is None:
        ctx.warn("invalid-primvar", prim.path, f"{name} is not an array of three floats each.")
        return None
    if raw_indices is not None:
        indices = array(raw_indices, 1, "i")
        if indices is None or (len(indices) and (indices.min() < 0 or indices.max() >= len(values))):
            ctx.warn("invalid-primvar", prim.path, f"{name} has indices outside its {len(values)} values.")
            return None
        values = values[indices]
    needed = sizes.of(interpolation)
    if interpolation == "constant" and len(values) >= 1:
        values = values[:1]
    if len(values) != needed:
        ctx.warn("invalid-primvar", prim.path, f"{name} ({interpolation}) has {len(values)} values where {needed} are needed.")
        return None
    return Primvar(values.astype(np.float32, copy=False), interpolation)


def per_corner(primvar: Primvar, triangles: Triangles) -> Floats:
    """(3T, 3): the values at every triangle's corners."""
    if primvar.interpolation == "constant":
        return np.repeat(primvar.values, triangles.points.size, axis=0)
    if primvar.interpolation == "uniform":
        return np.repeat(primvar.values[triangles.faces], 3, axis=0)
    if primvar.interpolation in ("vertex", "varying"):
        return primvar.values[triangles.points.ravel()]
    return primvar.values[triangles.corners.ravel()]


def is_per_point(primvar: Primvar) -> bool:
    return primvar.interpolation in ("vertex", "varying")
