"""UsdGeomBasisCurves to tubes: points and widths to control points, primvars along, surfaces assigned."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....arrays import Floats
from ....description import Curves, PrimvarInput, Shape, Surface
from ...curves.authored import AuthoredCurves, note_left_out, read_curves
from ...curves.basis import BEZIER, BSPLINE, CATMULL_ROM, basis_curves
from ...curves.curve_set import CurveSet
from ...curves.values import DISPLAY_COLOR, curve_primvars, radii
from ...paths.curves import moving_controls
from ...resolving.context import Context
from ...resolving.read import token
from ...resolving.resolve import ResolvedPrim
from ..materials.surface import FALLBACK_COLOR, Appearance, appearance_of, is_hidden, make_surface, undisplaced


@dataclass(frozen=True, eq=False)
class CurveGeometry:
    """What does not depend on materials."""

    authored: AuthoredCurves
    curves: CurveSet
    radii: Floats  # (3 S + C,) at the frame


def basis_curves_of(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    authored = read_curves(prim, ctx)
    if authored is None:
        return None
    kind, basis, wrap = (_allowed(prim, name, default, allowed, ctx) for name, default, allowed in _TOKENS)
    curves = basis_curves(authored.counts, len(authored.points), authored.good, kind, basis, wrap)
    why = f"their vertices do not fit {kind} curves of the basis {basis}, {wrap}, or are not finite"
    note_left_out(len(authored.counts), len(curves.drawn), why, prim, ctx)
    if not len(curves.drawn):
        return None
    return tubes(prim, CurveGeometry(authored, curves, radii(prim, curves, authored.points, ctx)), ctx)


_TOKENS = (
    ("type", "cubic", ("cubic", "linear")),
    ("basis", BEZIER, (BEZIER, BSPLINE, CATMULL_ROM)),
    ("wrap", "nonperiodic", ("nonperiodic", "periodic", "pinned")),
)


def _allowed(prim: ResolvedPrim, name: str, default: str, allowed: tuple[str, ...], ctx: Context) -> str:
    found = token(prim.prim, name, ctx.when, default)
    if found in allowed:
        return found
    ctx.warn("invalid-curves", prim.path, f"{name} = {found!r} is none of {', '.join(allowed)}: {default} is used.", name)
    return default


def tubes(prim: ResolvedPrim, geometry: CurveGeometry, ctx: Context) -> Curves | None:
    appearance = _colored(appearance_of(prim, prim.material, ctx))
    if is_hidden(appearance) or not geometry.radii.any():
        return None
    surface = undisplaced(make_surface(appearance, lambda: True, prim.path, ctx), prim.path, ctx)
    if emits(surface):
        ctx.warn("curve-lights", prim.path, "Its curves emit light that rays find by chance: expect noise.")
    curves = geometry.curves
    controls = np.column_stack([curves.controls(geometry.authored.points), geometry.radii])
    return Curves(
        prim.path,
        controls,
        curves.segments.astype(np.int32),
        ctx.surfaces.index_of(surface),
        curves.closed,
        curves.joined,
        curve_primvars(prim, (surface,), curves, ctx),
        motion=moving_controls(prim, geometry.authored, curves, controls, ctx),
    )


def _colored(appearance: Appearance) -> Appearance:
    """With displayColor read as any primvar, where it varies."""
    if not appearance.varying_color:
        return appearance
    inputs = (*appearance.inputs, ("diffuse_color", PrimvarInput(DISPLAY_COLOR, FALLBACK_COLOR)))
    return replace(appearance, color=FALLBACK_COLOR, varying_color=False, inputs=inputs)


def emits(surface: Surface) -> bool:
    return any(surface.emissive_color) or any(name == "emissive_color" for name, _ in surface.inputs)
