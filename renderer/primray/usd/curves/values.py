"""Widths, normals and primvars of curves at control points, segment ends or curves, by their interpolation."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from pxr import UsdGeom

from ...arrays import Floats
from ...description import Interpolation, Surface
from ...description import Primvar as SeamPrimvar
from ..mesh.authored import read_normals
from ..primvars.reading import Primvar, checked_vectors, read_authored, report_clamped_color
from ..primvars.surface_primvars import read_primvars
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.reads import element_size, metadatum
from ..stage.values import When, array, as_columns, value
from .bezier import EVENLY, CurveSet, Ints, Mask

STORMS_WIDTH = 1.0  # Hydra Storm's, if none is authored
# Lines without widths are usually tool paths or guides, not tubes of unit width: they are drawn thin enough to cover a pixel or
# two when the prim's curves fill the picture.
THIN = 1 / 500
DISPLAY_COLOR = "displayColor"
NO_WIDTH = 1e-6  # of the largest half width: rounding error


def name_of_widths(prim: ResolvedPrim) -> str:
    """Return the name of the attribute with the widths: primvars:widths takes precedence over widths."""
    return "primvars:widths" if "primvars:widths" in prim.names else "widths"


def read_widths(prim: ResolvedPrim, when: When) -> Primvar | None:
    """Return the authored widths in one column, or None if there are none or they cannot be read; not yet validated against the
    curves."""
    name = name_of_widths(prim)
    attribute = prim.prim.GetAttribute(name)
    if not attribute or value(attribute, when) is None:
        return None
    if name == "widths":
        values = array(value(attribute, when), 1, "f")
        kind = metadatum(attribute, "interpolation")
        return None if values is None else Primvar(values[:, None].astype(np.float32), str(kind or "vertex"))
    authored = read_authored(attribute, when)
    assert authored is not None
    columns = as_columns(authored.values, element_size(UsdGeom.Primvar(attribute)))
    indices = None if authored.indices is None else array(authored.indices, 1, "i")
    if columns is None or columns.shape[1] != 1 or (authored.indices is not None and indices is None):
        return None
    if indices is not None and len(indices) and (indices.min() < 0 or indices.max() >= len(columns)):
        return None
    return Primvar(columns if indices is None else columns[indices], authored.interpolation)


def radii_of(widths: Primvar, curves: CurveSet) -> Floats | None:
    """Return radii at control points (3 S + C,); None if the widths do not fit the curves."""
    halves = _halves(widths, curves)
    return None if halves is None else _not_negative(halves, curves)[0]


def _not_negative(halves: Floats, curves: CurveSet) -> tuple[Floats, int]:
    """Return the half widths, set to 0 where the control points of a segment make it negative, and the number of such
    segments."""
    if not (halves < 0).any():
        return halves, 0
    narrow = _narrower_than_0(halves, curves)
    return np.where(_controls_of(narrow, curves), np.maximum(halves, np.float32(0)), halves), int(narrow.sum())


def _halves(widths: Primvar, curves: CurveSet) -> Floats | None:
    at = at_controls(widths, curves)
    return None if at is None else np.nan_to_num(at[:, 0] * np.float32(0.5), nan=0.0, posinf=0.0, neginf=0.0)


def _narrower_than_0(halves: Floats, curves: CurveSet) -> Mask:
    """Return the mask (S,) of segments whose radius, a cubic of its four control values, is negative anywhere."""
    a, b, c, d = halves[_first_controls(curves)[:, None] + np.arange(4)].astype(np.float64).T
    least = np.minimum(a, d)
    # Roots of the derivative, whose control values are b - a, c - b, d - c, by the quadratic formula without cancellation.
    p, q, r = (b - a) - 2 * (c - b) + (d - c), (c - b) - (b - a), b - a
    root = np.sqrt(np.maximum(q * q - p * r, 0.0))
    stable = -(q + np.copysign(root, q))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = (stable / p, r / stable)
    for u in (np.clip(np.nan_to_num(found, nan=0.0), 0.0, 1.0) for found in roots):
        v = 1.0 - u
        least = np.minimum(least, a * v**3 + 3 * b * v * v * u + 3 * c * v * u * u + d * u**3)
    return np.asarray(least < -NO_WIDTH * np.abs(halves).max(initial=0.0))


def _first_controls(curves: CurveSet) -> Ints:
    """Return the index of each segment's first control point (S,)."""
    return 3 * np.arange(int(curves.segments.sum())) + np.repeat(np.arange(len(curves.segments)), curves.segments)


def _controls_of(segments: Mask, curves: CurveSet) -> Mask:
    """Return the mask (3 S + C,) of control points of the segments in a mask (S,)."""
    found = np.zeros(_control_count(curves), bool)
    first = _first_controls(curves)
    for k in range(4):
        found[first[segments] + k] = True
    return found


def with_fitting_interpolation(primvar: Primvar, curves: CurveSet) -> Primvar | None:
    """Return the primvar with an interpolation that its number of values fits, trying its own first; None if none fits."""
    count = len(primvar.values)
    order = [primvar.interpolation, "constant", "vertex", "varying", "uniform"]
    found = next((kind for kind in order if count and curves.sizes.of(kind) == count), None)
    return None if found is None else replace(primvar, interpolation=found)


def at_controls(primvar: Primvar, curves: CurveSet) -> Floats | None:
    """Return values at control points (3 S + C, k), or None if their number does not fit their interpolation."""
    values, kind = primvar.flat(), primvar.interpolation
    if len(values) != curves.sizes.of(kind):
        return None
    if kind == "constant":
        return np.repeat(values[:1], 3 * int(curves.segments.sum()) + len(curves.segments), axis=0)
    if kind == "uniform":
        return curves.per_control(values[curves.drawn])
    return curves.controls(values) if kind == "vertex" else curves.controls_of_ends(curves.at_ends(values))


def radii(prim: ResolvedPrim, curves: CurveSet, points: Floats, ctx: Context) -> Floats:
    """Return radii at control points (3 S + C,) at the frame; reports widths that are missing or do not fit."""
    authored, name = read_widths(prim, ctx.when), name_of_widths(prim)
    if authored is None or not len(authored.values):
        width = _default_width(points)
        message = f"It has no widths: its curves have a width of {width:.3g}, 1/{1 / THIN:g} of their overall extent"
        ctx.warn("curve-widths", prim.path, f"{message} and at most {STORMS_WIDTH:g}.", "widths")
        return np.full(_control_count(curves), width / 2, np.float32)
    fits = with_fitting_interpolation(authored, curves)
    if fits is None:
        usable = authored.values[np.isfinite(authored.values) & (authored.values > 0)]
        width = float(usable.mean()) if len(usable) else 0.0
        wanted = curves.sizes.of(authored.interpolation)
        message = f"{name} ({authored.interpolation}) has {len(authored.values)} values where {wanted} are needed"
        ctx.warn("curve-widths", prim.path, f"{message}: their mean, {width:.3g}, is used for all curves.", name)
        return np.full(_control_count(curves), width / 2, np.float32)
    if fits.interpolation != authored.interpolation and len(authored.values) != 1:
        message = f"{name} ({authored.interpolation}) has as many values as {fits.interpolation} needs, and is read as that."
        ctx.warn("curve-widths", prim.path, message, name)
    fits = _valid_widths(fits, name, curves, prim, ctx)
    halves = _halves(fits, curves)
    assert halves is not None
    found, narrow = _not_negative(halves, curves)
    if narrow:
        ctx.warn(
            "curve-widths", prim.path, f"{name} would be negative on {narrow} segments: they are clamped to 0 there.", name
        )
    return found


def _valid_widths(fits: Primvar, name: str, curves: CurveSet, prim: ResolvedPrim, ctx: Context) -> Primvar:
    """Report and replace invalid widths. Of widths that a basis is applied to, only the results must not be negative."""
    is_based = fits.interpolation == "vertex" and curves.to_bezier is not EVENLY
    bad = ~np.isfinite(fits.values) if is_based else ~(np.isfinite(fits.values) & (fits.values >= 0))
    if bad.any():
        message = f"{name} has {int(bad.sum())} values that are {'' if is_based else 'negative or '}not finite: 0 is used."
        ctx.warn("curve-widths", prim.path, message, name)
        fits = replace(fits, values=np.where(bad, np.float32(0), fits.values))
    return fits


def _default_width(points: Floats) -> float:
    good = points[np.isfinite(points).all(axis=1)].astype(np.float64)
    return min(STORMS_WIDTH, THIN * float(np.linalg.norm(np.ptp(good, axis=0)))) if len(good) else 0.0


def _control_count(curves: CurveSet) -> int:
    return 3 * int(curves.segments.sum()) + len(curves.segments)


def control_normals(prim: ResolvedPrim, curves: CurveSet, ctx: Context) -> Floats | None:
    """Return normals at control points (3 S + C, 3) for ribbons; None for tubes, and, reported, for normals that do not fit."""
    authored = read_normals(prim, ctx.when)
    found = None if authored is None else checked_vectors(authored, curves.sizes, prim.path, ctx)
    return None if found is None else at_controls(found, curves)


def curve_primvars(
    prim: ResolvedPrim, surfaces: Collection[Surface], curves: CurveSet, ctx: Context
) -> tuple[SeamPrimvar, ...]:
    """Return the primvars that surfaces read, as description.Curves has them."""
    if not ctx.aov_primvars and not any(surface.inputs for surface in surfaces):
        return ()
    colored = replace(ctx, color_primvars=ctx.color_primvars | {f"primvars:{DISPLAY_COLOR}"})
    found = read_primvars(prim, surfaces, curves.sizes, colored)
    return tuple(_described_primvar(name, _clamped_display_color(name, primvar, prim, ctx), curves) for name, primvar in found)


def _clamped_display_color(name: str, primvar: Primvar, prim: ResolvedPrim, ctx: Context) -> Primvar:
    """Return displayColor clamped to [0, 1], so that surfaces conserve energy; other primvars unchanged."""
    if name != DISPLAY_COLOR:
        return primvar
    inside = np.clip(primvar.values, 0.0, 1.0)
    if (outside := int(np.count_nonzero((inside != primvar.values).any(axis=1)))) == 0:
        return primvar
    report_clamped_color(f"{outside} values of primvars:{DISPLAY_COLOR} are", prim, ctx)
    return replace(primvar, values=inside)


def _described_primvar(name: str, primvar: Primvar, curves: CurveSet) -> SeamPrimvar:
    values, kind = primvar.flat(), primvar.interpolation
    if kind == "constant":
        return SeamPrimvar(name, Interpolation.CONSTANT, values)
    if kind == "uniform":
        return SeamPrimvar(name, Interpolation.FACE, values[curves.drawn])
    if kind == "vertex":
        return SeamPrimvar(name, Interpolation.POINT, curves.controls(values))
    return SeamPrimvar(name, Interpolation.CORNER, curves.at_ends(values))
