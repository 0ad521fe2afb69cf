"""UsdLux ShapingAPI of one light: focus, cone and IES profile.

Authored attributes count even if the schema is not applied. The schema's fallback values (a cone of 90 degrees) count only
if it is applied. IES files are resolved by Ar, and read once even if many lights name the same file.
"""

from __future__ import annotations

import numpy as np
from pxr import Sdf

from ...arrays import Doubles
from ...description import IesProfile, Shaping
from ...errors import AssetError
from ...file_formats import WHAT_IT_IS, is_pointer
from ...textures.ies import MAX_BYTES, IesError, IesFile, parse_ies
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.reads import read_asset
from ..stage.values import flag, number, read
from .light_color import light_color

FOCUS, TINT = "inputs:shaping:focus", "inputs:shaping:focusTint"
ANGLE, SOFTNESS = "inputs:shaping:cone:angle", "inputs:shaping:cone:softness"
SCALE, NORMALIZE = "inputs:shaping:ies:angleScale", "inputs:shaping:ies:normalize"
_NEUTRAL_ANGLE = 180.0
_WHITE = (1.0, 1.0, 1.0)


def read_shaping(prim: ResolvedPrim, ctx: Context) -> Shaping | None:
    """Return the shaping of a light as authored; None if there is none."""
    applied = _is_shaping_applied(prim)
    if not applied and not _authored_shaping(prim):
        return None
    profile = _profile(prim, ctx)
    return Shaping(
        focus=_focus(prim, ctx),
        focus_tint=_tint(prim, ctx),
        cone_angle_deg=_cone_angle(prim, 90.0 if applied else _NEUTRAL_ANGLE, ctx),
        cone_softness=_softness(prim, ctx),
        ies=profile,
        ies_angle_scale=number(prim.prim, SCALE, ctx.when, 0.0, ctx.diagnostics),
        ies_normalize=profile is not None and profile.power > 0 and flag(prim.prim, NORMALIZE, ctx.when, False),
    )


def peak_factor(found: Shaping | None) -> float:
    """Return the largest factor by which shaping scales any component of the emission."""
    if found is None:
        return 1.0
    focus = max(1.0, *found.focus_tint) if found.focus > 0 else 1.0
    if found.ies is None:
        return focus
    divisor = found.ies.power if found.ies_normalize else 1.0
    return focus * float(found.ies.candela.max()) / divisor


def report_ignored_shaping(prim: ResolvedPrim, ctx: Context) -> None:
    """Report shaping attributes of a light type to which shaping does not apply."""
    for name in sorted(_authored_shaping(prim)):
        raw = read(prim.prim, name, ctx.when)
        if name == FILE and not (isinstance(raw, Sdf.AssetPath) and raw.path):
            continue
        if (name == FOCUS and raw in (None, 0.0)) or (name == ANGLE and isinstance(raw, float) and raw >= 180.0):
            continue
        message = f"{name} is ignored: shaping does not apply to a {prim.type_name}."
        ctx.warn("light-input", prim.path, message, name)


def _is_shaping_applied(prim: ResolvedPrim) -> bool:
    return bool(prim.prim.HasAPI("ShapingAPI"))


def _authored_shaping(prim: ResolvedPrim) -> list[str]:
    return [name for name in prim.names if name.startswith("inputs:shaping:")]


def _focus(prim: ResolvedPrim, ctx: Context) -> float:
    """Return the focus, 0 or more: "Values < 0 are ignored" (ShapingAPI)."""
    focus = number(prim.prim, FOCUS, ctx.when, 0.0, ctx.diagnostics)
    if focus < 0:
        ctx.warn("light-input", prim.path, f"{FOCUS} = {focus:g} is negative: it is ignored.", FOCUS)
    return max(focus, 0.0)


def _tint(prim: ResolvedPrim, ctx: Context) -> tuple[float, float, float]:
    r, g, b = light_color(prim, TINT, (0.0, 0.0, 0.0), ctx)
    if min(r, g, b) < 0:
        ctx.warn("out-of-range", prim.path, f"{TINT} = ({r:g}, {g:g}, {b:g}) is negative: it is clamped to 0.", TINT)
    return (max(r, 0.0), max(g, 0.0), max(b, 0.0))


def _cone_angle(prim: ResolvedPrim, default: float, ctx: Context) -> float:
    angle = number(prim.prim, ANGLE, ctx.when, default, ctx.diagnostics)
    if angle <= 0:
        ctx.warn("light-dark", prim.path, f"{ANGLE} = {angle:g} is an empty cone: the light emits nothing.", ANGLE)
    return angle


def _softness(prim: ResolvedPrim, ctx: Context) -> float:
    """Return the softness: "Values outside of the [0, 1] range are clamped to the range" (ShapingAPI)."""
    softness = number(prim.prim, SOFTNESS, ctx.when, 0.0, ctx.diagnostics)
    inside = min(max(softness, 0.0), 1.0)
    if inside != softness:
        message = f"{SOFTNESS} = {softness:g} is outside [0, 1]: {inside:g} is used."
        ctx.warn("out-of-range", prim.path, message, SOFTNESS)
    return inside


def _profile(prim: ResolvedPrim, ctx: Context) -> IesProfile | None:
    asset = read(prim.prim, FILE, ctx.when)
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return None
    return ies_profile(asset, prim.path, ctx)


def changes_emission(found: Shaping, prim: ResolvedPrim, matrix: Doubles) -> bool:
    """Return whether shaping changes the emission of a light with this world matrix."""
    if found.ies is not None or (found.focus > 0 and found.focus_tint != _WHITE) or found.cone_softness > 0:
        return True
    # A flat light whose normal is -Z emits nothing beyond 90 degrees, so a wider cone changes nothing.
    flat = prim.type_name in ("RectLight", "DiskLight") and _is_straight(matrix)
    return found.cone_angle_deg < (90.0 if flat else _NEUTRAL_ANGLE)


def _is_straight(matrix: Doubles) -> bool:
    x, y, z = matrix[:3, :3].T
    size = float(np.linalg.norm(z))
    return all(abs(float(axis @ z)) <= 1e-9 * size * float(np.linalg.norm(axis)) for axis in (x, y)) and size > 0


FILE = "inputs:shaping:ies:file"


def missing_text(path: str) -> str:
    """Return the message for an IES file that does not exist."""
    return f"{path} cannot be found: the light is rendered without a profile."


def ies_profile(asset: Sdf.AssetPath, path: str, ctx: Context) -> IesProfile | None:
    """Return the profile; None, with a diagnostic for the light at `path`, if it cannot be read."""
    if not asset.resolvedPath:
        ctx.warn("asset-missing", path, missing_text(asset.path), FILE)
        return None
    resolved = str(asset.resolvedPath)
    known = ctx.caches.ies_files
    if resolved not in known:
        known[resolved] = _read_ies_file(resolved)
    found = known[resolved]
    if isinstance(found, str):
        ctx.warn("light-input", path, f"{asset.path} is ignored, and the light rendered without it: {found}.", FILE)
        return None
    for note in found.notes:
        ctx.warn("light-input", path, f"{asset.path}: {note}.", FILE)
    if not found.profile.candela.any():
        ctx.warn("light-dark", path, f"{asset.path} has no intensity above 0: the light emits nothing.", FILE)
    return found.profile


def _read_ies_file(resolved: str) -> IesFile | str:
    """Return the parsed file, or a sentence on why it cannot be used."""
    try:
        content = read_asset(resolved, MAX_BYTES)
        return WHAT_IT_IS if is_pointer(content) else parse_ies(content)
    except IesError as error:
        return str(error)
    except AssetError as error:
        return error.message
