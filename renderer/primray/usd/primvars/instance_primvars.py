"""Primvars of a point instancer with one value per instance: displayColor, displayOpacity and those that the stage's materials
read.

They are constant at the root of each instance (UsdGeomPointInstancer, "Primvars on PointInstancer"). A primvar of the prototype
itself, or one authored between it and the instancer, takes precedence.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from pxr import UsdGeom

from ...description import Interpolation, Placement, Primvar, Prototype, Shape, Surface
from ..scene.context import Context
from ..scene.inheritance import Inherited, ResolvedPrim
from ..stage.reads import interpolation
from .reading import Sizes, as_colors, finite_values, read_raw_primvar
from .surface_primvars import names_read

# Primvars that shapes without a material read, with their number of components.
_DISPLAY_PRIMVARS = {"displayColor": 3, "displayOpacity": 1}


def instance_primvars(prim: ResolvedPrim, count: int, ctx: Context) -> tuple[Primvar, ...]:
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
        found.append(Primvar(short, Interpolation.INSTANCE, values))
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
