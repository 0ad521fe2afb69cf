"""Reading and validation of gprim primvars: any type of one to four numbers, any interpolation, indexed or not.

An elementSize of n makes n consecutive values one element: float[] with elementSize 2 is read as pairs. Values that are not
finite are read as 0 and reported.
"""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from pxr import Usd, UsdGeom

from ...arrays import Floats
from ..mesh.triangulate import Triangles
from ..scene.color_spaces import in_rendering_space
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.reads import element_size, interpolation
from ..stage.values import MAX_COLUMNS, When, array, as_columns, is_single, value


@dataclass(frozen=True)
class Primvar:
    """Primvar with `values` (M, components), one row per element of its `interpolation` (USD's token), or one per index where
    indexed."""

    values: Floats
    interpolation: str
    indices: npt.NDArray[np.int32] | None = None

    def flat(self) -> Floats:
        return self.values if self.indices is None else self.values[self.indices]


@dataclass(frozen=True, eq=False)
class AuthoredPrimvar:
    """Primvar as authored, of any type, not yet validated."""

    name: str  # name of the attribute
    values: object
    interpolation: str
    indices: object = None  # None if not indexed
    element_size: int = 1


@dataclass(frozen=True)
class Sizes:
    """Number of elements for each interpolation on one mesh, or on curves, which count as faces."""

    faces: int
    points: int
    corners: int
    ends: int | None = None  # of 'varying', where it differs from 'vertex'

    def of(self, interpolation: str) -> int:
        varying = self.points if self.ends is None else self.ends
        return {"constant": 1, "uniform": self.faces, "vertex": self.points, "varying": varying}.get(
            interpolation, self.corners if self.ends is None else varying
        )


def read_display_color(sizes: Sizes, prim: ResolvedPrim, ctx: Context) -> Primvar | None:
    """Return primvars:displayColor, indexed or not, in the rendering space and clamped to [0, 1], so that surfaces conserve
    energy."""
    attribute = prim.prim.GetAttribute("primvars:displayColor")
    found = read_raw_primvar(attribute, sizes, prim, ctx)
    if found is None:
        return None
    found = as_colors(found, attribute, prim, ctx)
    inside = np.clip(found.values, 0.0, 1.0)
    outside = int(np.count_nonzero((inside != found.values).any(axis=1)))
    if not outside:
        return found
    report_clamped_color(f"{outside} values of primvars:displayColor are", prim, ctx)
    return replace(found, values=inside)


def as_colors(primvar: Primvar, attribute: Usd.Attribute, prim: ResolvedPrim, ctx: Context) -> Primvar:
    """Return the primvar with its first three components converted to the rendering space; unchanged if it has fewer than
    three."""
    if primvar.values.shape[1] < 3:
        return primvar
    given = primvar.values[:, :3]
    converted = in_rendering_space(given, attribute, prim.inherited.colors, ctx)
    if converted is given:
        return primvar
    return replace(primvar, values=np.concatenate([converted, primvar.values[:, 3:]], axis=1).astype(np.float32))


def report_clamped_color(what: str, prim: ResolvedPrim, ctx: Context) -> None:
    ctx.warn("out-of-range", prim.path, f"{what} outside [0, 1] and clamped.", "primvars:displayColor")


def read_display_vectors(sizes: Sizes, prim: ResolvedPrim, ctx: Context) -> Primvar | None:
    """Return primvars:displayColor with indices applied; None, and reported, if it does not have three components."""
    return _three_components(read_display_color(sizes, prim, ctx), "primvars:displayColor", prim.path, ctx)


def checked_vectors(authored: AuthoredPrimvar, sizes: Sizes, path: str, ctx: Context) -> Primvar | None:
    """Return values of three components with indices applied; None, and reported, if they do not fit the mesh."""
    return _three_components(_checked(authored, sizes, path, ctx), authored.name, path, ctx)


def _three_components(found: Primvar | None, name: str, path: str, ctx: Context) -> Primvar | None:
    if found is None:
        return None
    if found.values.shape[1] != 3:
        ctx.warn("invalid-primvar", path, f"{name} does not have three numbers for each element: it is ignored.", name)
        return None
    return Primvar(found.flat(), found.interpolation)


def read_raw_primvar(attribute: Usd.Attribute, sizes: Sizes, prim: ResolvedPrim, ctx: Context) -> Primvar | None:
    """Return a primvar of 1 to 4 components with its indices; None if it has no value, or, reported, if it does not fit the
    shape."""
    authored = read_authored(attribute, ctx.when)
    return None if authored is None else _checked(authored, sizes, prim.path, ctx)


def read_authored(attribute: Usd.Attribute, when: When) -> AuthoredPrimvar | None:
    """Return the primvar's value, indices, interpolation and element size; None if it has no value."""
    primvar = UsdGeom.Primvar(attribute)
    raw = value(attribute, when)
    if raw is None:
        return None
    if is_single(raw):
        raw = [raw]
    indices = value(primvar.GetIndicesAttr(), when) if primvar.IsIndexed() else None
    size = 1 if type(raw).__name__.startswith(("Vec3", "Vec4")) else element_size(primvar)
    return AuthoredPrimvar(attribute.GetName(), raw, interpolation(primvar), indices, size)


def _checked(authored: AuthoredPrimvar, sizes: Sizes, path: str, ctx: Context) -> Primvar | None:
    name, interpolation = authored.name, authored.interpolation
    if authored.element_size > 1 and _fits_without_element_size(authored, sizes):
        message = f"{name} has one value for each element but an elementSize of {authored.element_size}, which is ignored."
        ctx.warn("invalid-primvar", path, message, name)
        authored = replace(authored, element_size=1)
    values = as_columns(authored.values, authored.element_size)
    if values is None:
        of_size = f" of elementSize {authored.element_size}" if authored.element_size != 1 else ""
        ctx.warn(
            "invalid-primvar",
            path,
            f"{name}{of_size} does not have one to {MAX_COLUMNS} numbers for each element: it is ignored.",
            name,
        )
        return None
    indices = None
    if authored.indices is not None:
        indices = array(authored.indices, 1, "i")
        if indices is None or (len(indices) and (indices.min() < 0 or indices.max() >= len(values))):
            ctx.warn("invalid-primvar", path, f"{name} has indices outside its {len(values)} values.", name)
            return None
    needed = sizes.of(interpolation)
    count = len(values) if indices is None else len(indices)
    if interpolation == "constant" and count > 1:
        report_many_values(name, count, path, ctx)
        values, indices = values[:1] if indices is None else values[indices[:1]], None
        count = 1
    if count != needed:
        ctx.warn("invalid-primvar", path, f"{name} ({interpolation}) has {count} values where {needed} are needed.", name)
        return None
    return Primvar(values, interpolation, indices)


def _fits_without_element_size(authored: AuthoredPrimvar, sizes: Sizes) -> bool:
    """Return whether an array fits its interpolation only if elementSize is ignored.

    Some exporters write the number of corners per face as elementSize.
    """
    listed = authored.values if authored.indices is None else authored.indices
    if not isinstance(listed, Sized) or len(listed) != sizes.of(authored.interpolation):
        return False
    grouped = as_columns(authored.values, authored.element_size)
    return grouped is None or authored.indices is None


def report_many_values(name: str, count: int, path: str, ctx: Context) -> None:
    """Report a constant primvar with several elements (UsdGeomPrimvar: elementSize values); often its interpolation was left
    out."""
    if count > 1:
        ctx.warn("invalid-primvar", path, f"{name} (constant) has {count} values where 1 is needed: the first is used.", name)


def finite_values(values: Floats, name: str, prim: ResolvedPrim, ctx: Context) -> Floats:
    """Return the values with non-finite ones replaced by 0, and report those."""
    good = np.isfinite(values)
    if good.all():
        return values
    bad = int(np.count_nonzero(~good.all(axis=1)))
    ctx.warn("invalid-primvar", prim.path, f"{name} has {bad} values that are not finite: they are read as 0.", name)
    return np.where(good, values, np.float32(0))


def per_corner(primvar: Primvar, triangles: Triangles) -> Floats:
    """Return values (3T, components) at every triangle corner."""
    values = primvar.flat()
    if primvar.interpolation == "constant":
        return np.repeat(values, triangles.points.size, axis=0)
    if primvar.interpolation == "uniform":
        return np.repeat(values[triangles.faces], 3, axis=0)
    if primvar.interpolation in ("vertex", "varying"):
        return values[triangles.points.ravel()]
    return values[triangles.corners.ravel()]


def is_per_point(primvar: Primvar) -> bool:
    return primvar.interpolation in ("vertex", "varying")
