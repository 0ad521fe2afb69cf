"""UsdGeomBasisCurves to tubes, or with normals to ribbons: points and widths to control points, primvars along, surfaces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....arrays import Floats
from ....description import Curves, PrimvarInput, Ribbons, Shape, Surface
from ...curves.authored import AuthoredCurves, note_left_out, read_curves
from ...curves.basis import BEZIER, BSPLINE, CATMULL_ROM, basis_curves
from ...curves.curve_set import CurveSet
from ...curves.moving import moving_controls, with_normals
from ...curves.values import DISPLAY_COLOR, control_normals, curve_primvars, radii
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
    normals: Floats | None = None  # (3 S + C, 3) of ribbons


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
    normals = control_normals(prim, curves, ctx)
    return drawn(prim, CurveGeometry(authored, curves, radii(prim, curves, authored.points, ctx), normals), ctx)


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


def drawn(prim: ResolvedPrim, geometry: CurveGeometry, ctx: Context) -> Curves | Ribbons | None:
    appearance = _colored(appearance_of(prim, prim.material, ctx))
    if is_hidden(appearance) or not geometry.radii.any():
        return None
    is_tube = geometry.normals is None
    surface = undisplaced(make_surface(appearance, lambda: is_tube, prim.path, ctx), prim.path, ctx)
    if is_tube and emits(surface):
        ctx.warn("curve-lights", prim.path, "Its curves emit light that rays find by chance: expect noise.")
    curves = geometry.curves
    controls = np.column_stack([curves.controls(geometry.authored.points), geometry.radii])
    segments, number = curves.segments.astype(np.int32), ctx.surfaces.index_of(surface)
    primvars = curve_primvars(prim, (surface,), curves, ctx)
    motion = moving_controls(prim, geometry.authored, curves, controls, ctx)
    if geometry.normals is None:
        return Curves(prim.path, controls, segments, number, curves.closed, curves.joined, primvars, motion=motion)
    motion = None if motion is None else with_normals(motion, geometry.normals)
    return Ribbons(prim.path, controls, geometry.normals, segments, number, primvars, motion=motion)


def _colored(appearance: Appearance) -> Appearance:
    """With displayColor read as any primvar, where it varies."""
    if not appearance.varying_color:
        return appearance
    inputs = (*appearance.inputs, ("diffuse_color", PrimvarInput(DISPLAY_COLOR, FALLBACK_COLOR)))
    return replace(appearance, color=FALLBACK_COLOR, varying_color=False, inputs=inputs)


def emits(surface: Surface) -> bool:
    return any(surface.emissive_color) or any(name == "emissive_color" for name, _ in surface.inputs)
