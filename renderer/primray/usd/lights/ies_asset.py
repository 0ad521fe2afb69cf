"""IES photometric files of lights: resolved by Ar, and read once even if many lights name the same file."""

from __future__ import annotations

from pxr import Sdf

from ...description import IesProfile
from ...errors import AssetError
from ...lfs_pointer import WHAT_IT_IS, is_pointer
from ...textures.ies import MAX_BYTES, IesError, IesFile, parse_ies
from ..querying.asset import read_asset
from ..resolving.context import Context

FILE = "inputs:shaping:ies:file"


class Profiles(dict[str, IesFile | str]):
    """IES files by resolved path: the parsed file, or why it cannot be used."""


def missing_text(path: str) -> str:
    """Return the message for an IES file that does not exist."""
    return f"{path} cannot be found: the light is rendered without a profile."


def ies_profile(asset: Sdf.AssetPath, path: str, ctx: Context) -> IesProfile | None:
    """Return the profile; None, with a diagnostic for the light at `path`, if it cannot be read."""
    if not asset.resolvedPath:
        ctx.warn("asset-missing", path, missing_text(asset.path), FILE)
        return None
    resolved = str(asset.resolvedPath)
    known = ctx.kept.of(Profiles)
    if resolved not in known:
        known[resolved] = _read(resolved)
    found = known[resolved]
    if isinstance(found, str):
        ctx.warn("light-input", path, f"{asset.path} is ignored, and the light rendered without it: {found}.", FILE)
        return None
    for note in found.notes:
        ctx.warn("light-input", path, f"{asset.path}: {note}.", FILE)
    if not found.profile.candela.any():
        ctx.warn("light-dark", path, f"{asset.path} has no intensity above 0: the light emits nothing.", FILE)
    return found.profile


def _read(resolved: str) -> IesFile | str:
    """Return the parsed file, or a sentence on why it cannot be used."""
    try:
        content = read_asset(resolved, MAX_BYTES)
        return WHAT_IT_IS if is_pointer(content) else parse_ies(content)
    except IesError as error:
        return str(error)
    except AssetError as error:
        return error.message
