"""Primvars that the surfaces of a shape read, by name: from the shape itself, or constant ones inherited from its ancestors.

Where neither has one, that of the instance applies, else the input's fallback. A point instancer's primvars with one value per
instance (displayColor, displayOpacity and those that the stage's materials read) are constant at the root of each instance
(UsdGeomPointInstancer, "Primvars on PointInstancer"). A primvar of the prototype itself, or one authored between it and the
instancer, takes precedence.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom

from ...aovs import WIDE
from ...description import (
    Interpolation,
    PatternInput,
    Placement,
    PrimvarInput,
    Prototype,
    Shape,
    Surface,
    TextureInput,
)
from ...description import Primvar as DescribedPrimvar
from ...description.shading import pattern_fallbacks, pattern_primvars
from ..mesh.triangulate import Triangles
from ..scene.context import Context
from ..scene.inheritance import Inherited, ResolvedPrim, element_count
from ..stage.reads import interpolation
from .reading import Primvar, Sizes, as_colors, finite_values, is_per_point, per_corner, read_raw_primvar, report_many_values

NO_SIZES = Sizes(0, 0, 0)  # for shapes that take constant primvars only
TANGENT_ST = "st"  # defines the tangents of normals given by a primvar, and of tangent-space displacement


def names_read(surfaces: Iterable[Surface]) -> dict[str, int]:
    """Return the primvars that surfaces read, in order, with the number of components that each needs."""
    wanted: dict[str, int] = {}
    for surface in surfaces:
        for field, reads in surface.inputs:
            if not isinstance(reads, PatternInput):
                primvar = _primvar_of(reads)
                if primvar.name:
                    wanted[primvar.name] = max(wanted.get(primvar.name, 0), len(primvar.fallback))
            if (field == "normal" and isinstance(reads, PrimvarInput)) or field == "displacement_tangent":
                wanted.setdefault(TANGENT_ST, 2)
        for name, width in pattern_primvars(surface.pattern).items() if surface.pattern else ():
            wanted[name] = max(wanted.get(name, 0), width)
    return wanted


def _primvar_of(reads: PrimvarInput | TextureInput) -> PrimvarInput:
    return reads if isinstance(reads, PrimvarInput) else reads.st


def mesh_primvars(
    prim: ResolvedPrim, surfaces: Collection[Surface], triangles: Triangles, sizes: Sizes, ctx: Context
) -> tuple[DescribedPrimvar, ...]:
    """Return primvars per triangle, point or corner, as Mesh has them."""
    if not ctx.aov_primvars and not any(surface.inputs for surface in surfaces):
        return ()
    return tuple(_on_triangles(name, found, triangles) for name, found in read_primvars(prim, surfaces, sizes, ctx))


def constant_primvars(prim: ResolvedPrim, surfaces: Collection[Surface], ctx: Context) -> tuple[DescribedPrimvar, ...]:
    """Return the constant primvars of a shape without points; those that vary over it are reported and left out."""
    if not ctx.aov_primvars and not any(surface.inputs for surface in surfaces):
        return ()
    return tuple(
        DescribedPrimvar(name, Interpolation.CONSTANT, found.flat())
        for name, found in read_primvars(prim, surfaces, NO_SIZES, ctx)
        if found.interpolation == "constant"
    )


def read_primvars(
    prim: ResolvedPrim,
    surfaces: Iterable[Surface],
    sizes: Sizes,
    ctx: Context,
    instead: Mapping[str, Primvar] = MappingProxyType({}),
) -> list[tuple[str, Primvar]]:
    """Return the primvars that surfaces read from a shape, by name, validated against its sizes and cut to the components that
    are read. `instead` has values for names that neither the shape nor an instance provides."""

    @cache
    def read(name: str) -> Primvar | None:
        found = _own(prim, name, sizes, ctx) or _handed_down(prim, name, ctx)
        return found if found is not None or name in prim.inherited.per_instance else instead.get(name)

    found = []
    for name, width in names_read(surfaces).items():
        primvar = read(name)
        if primvar is None:
            if name not in prim.inherited.per_instance:
                message = f"A material reads primvars:{name}, which the prim does not have: the fallback is used."
                ctx.warn("primvar-missing", prim.path, message, f"primvars:{name}")
            if name in prim.inherited.hidden:
                found += _fallback_over_instances(prim, name, surfaces, ctx)
        elif primvar.values.shape[1] < width:
            message = f"primvars:{name} has too few components, {width} are needed: it is ignored."
            ctx.warn("invalid-primvar", prim.path, message, f"primvars:{name}")
        else:
            values = np.ascontiguousarray(finite_values(primvar.values, f"primvars:{name}", prim, ctx)[:, :width])
            found.append((name, Primvar(values, primvar.interpolation, primvar.indices)))
    return found + _for_aovs(prim, {name: p.values.shape[1] for name, p in found}, read, ctx) if ctx.aov_primvars else found


def _fallback_over_instances(
    prim: ResolvedPrim, name: str, surfaces: Iterable[Surface], ctx: Context
) -> list[tuple[str, Primvar]]:
    """Return the readers' fallback as the shape's own primvar, where an unusable primvar hides the instances' values."""
    fallbacks: set[tuple[float, ...] | None] = set()
    for surface in surfaces:
        inputs = [read for _, read in surface.inputs if not isinstance(read, PatternInput)]
        fallbacks |= {primvar.fallback for primvar in map(_primvar_of, inputs) if primvar.name == name}
        if surface.pattern and name in pattern_primvars(surface.pattern):
            fallbacks |= pattern_fallbacks(surface.pattern, name)
    fallback = fallbacks.pop() if len(fallbacks) == 1 else None
    if fallback is not None:
        return [(name, Primvar(np.array([fallback], np.float32), "constant"))]
    message = (
        f"primvars:{name} is unusable, but stronger than the instances' values. These are used, "
        "since the inputs that read it have different fallbacks."
    )
    ctx.warn("instance-primvar", prim.path, message, f"primvars:{name}")
    return []


def _for_aovs(
    prim: ResolvedPrim, widths: dict[str, int], read: Callable[[str], Primvar | None], ctx: Context
) -> list[tuple[str, Primvar]]:
    """Return the primvars that AOVs need beyond those the surfaces read (`widths`), with all their components."""
    found = []
    for name in ctx.aov_primvars:
        primvar = read(name)
        if primvar is not None and primvar.values.shape[1] != widths.get(name):
            values = np.ascontiguousarray(finite_values(primvar.values, f"primvars:{name}", prim, ctx))
            found.append((WIDE + name if name in widths else name, Primvar(values, primvar.interpolation, primvar.indices)))
    return found


def _own(prim: ResolvedPrim, name: str, sizes: Sizes, ctx: Context) -> Primvar | None:
    if f"primvars:{name}" not in prim.names:
        return None
    attribute = prim.prim.GetAttribute(f"primvars:{name}")
    found = read_raw_primvar(attribute, sizes, prim, ctx) if attribute.HasAuthoredValue() else None
    is_color = found is not None and f"primvars:{name}" in ctx.color_primvars
    return as_colors(found, attribute, prim, ctx) if found is not None and is_color else found


def _handed_down(prim: ResolvedPrim, name: str, ctx: Context) -> Primvar | None:
    """Return an inherited primvar; only constant primvars are inherited (UsdGeomPrimvarsAPI)."""
    for handed, values in prim.inherited.primvars:
        if handed == name:
            report_many_values(f"primvars:{name}", element_count(prim.inherited, f"primvars:{name}"), prim.path, ctx)
            return Primvar(np.array([values], np.float32), "constant")
    return None


def _on_triangles(name: str, primvar: Primvar, triangles: Triangles) -> DescribedPrimvar:
    if primvar.interpolation == "constant":
        return DescribedPrimvar(name, Interpolation.CONSTANT, primvar.flat())
    if primvar.interpolation == "uniform":
        return DescribedPrimvar(name, Interpolation.FACE, primvar.flat()[triangles.faces])
    if is_per_point(primvar):
        return DescribedPrimvar(name, Interpolation.POINT, primvar.flat())
    return DescribedPrimvar(name, Interpolation.CORNER, per_corner(primvar, triangles))


def primvars_of_triangles(primvars: tuple[DescribedPrimvar, ...], keep: npt.NDArray[np.bool_]) -> tuple[DescribedPrimvar, ...]:
    """Return the primvars of a subset of triangles; `keep` is a (T,) mask."""
    rows = {Interpolation.FACE: keep, Interpolation.CORNER: np.repeat(keep, 3)}
    return tuple(replace(p, values=p.values[rows[p.interpolation]]) if p.interpolation in rows else p for p in primvars)


# Primvars that shapes without a material read, with their number of components.
_DISPLAY_PRIMVARS = {"displayColor": 3, "displayOpacity": 1}


def instance_primvars(prim: ResolvedPrim, count: int, ctx: Context) -> tuple[DescribedPrimvar, ...]:
    """Return every primvar that is not constant over the instancer, with one row per instance, hidden ones included."""
    found = []
    for name in sorted(prim.names & (ctx.primvars_read | {f"primvars:{shown}" for shown in _DISPLAY_PRIMVARS})):
        attribute = prim.prim.GetAttribute(name)
        if interpolation(UsdGeom.Primvar(attribute)) == "constant" or not attribute.HasAuthoredValue():
            continue
        primvar = read_raw_primvar(attribute, Sizes(1, count, count), prim, ctx)
        if primvar is None:
            continue
        if name in ctx.color_primvars:
            primvar = as_colors(primvar, attribute, prim, ctx)
        short = name.removeprefix("primvars:")
        if primvar.values.shape[1] != _DISPLAY_PRIMVARS.get(short, primvar.values.shape[1]):
            ctx.warn(
                "instance-primvar",
                prim.path,
                f"{name} has {primvar.values.shape[1]} numbers per instance, not {_DISPLAY_PRIMVARS[short]}: it is ignored.",
                name,
            )
            continue
        values = finite_values(primvar.flat(), name, prim, ctx)
        if primvar.interpolation == "uniform":  # the whole value applies to each instance
            values = np.repeat(values, count, axis=0)
        found.append(DescribedPrimvar(short, Interpolation.INSTANCE, values))
    return tuple(found)


def without_overridden(handed: Inherited, names: Iterable[str]) -> Inherited:
    """Return the inherited state for a prototype whose instances have their own values for the primvars of these names."""
    given = frozenset(names)
    if not given:
        return handed
    return replace(
        handed,
        color=None if "displayColor" in given else handed.color,
        opacity=None if "displayOpacity" in given else handed.opacity,
        primvars=tuple(item for item in handed.primvars if item[0] not in given),
        per_instance=handed.per_instance | given,
        hidden=handed.hidden - given,
    )


def without_unread_primvars(
    placements: Sequence[Placement],
    prototypes: Sequence[Prototype],
    shapes: Sequence[Shape],
    surfaces: Sequence[Surface],
    others: Sequence[str] = (),
) -> tuple[Placement, ...]:
    """Return the placements without the primvars that no surface of their prototypes reads, except those named in `others`."""
    return tuple(_without_unread(p, prototypes[p.prototype], shapes, surfaces, others) if p.primvars else p for p in placements)


def _without_unread(
    placement: Placement, prototype: Prototype, shapes: Sequence[Shape], surfaces: Sequence[Surface], others: Sequence[str]
) -> Placement:
    if prototype.placements:
        return placement
    used = {int(s) for placed in prototype.shapes for s in np.unique(shapes[placed.shape].surface) if s >= 0}
    wanted = {*names_read(surfaces[i] for i in used), *others}
    return replace(placement, primvars=tuple(p for p in placement.primvars if p.name in wanted))
