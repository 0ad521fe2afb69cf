"""A light's photometric file as an IesProfile: resolved by Ar, read once however many lights name it."""

from __future__ import annotations

from pxr import Sdf

from ...description.lighting import IesProfile
from ...errors import AssetError
from ...lfs_pointer import WHAT_IT_IS, is_pointer
from ...textures.ies import MAX_BYTES, IesError, IesFile, parse_ies
from ..querying.asset import read_asset
from ..resolving.context import Context

FILE = "inputs:shaping:ies:file"


class Profiles(dict[str, IesFile | str]):
    """By the resolved path of the file: the file, or what is wrong with it."""


def missing_text(path: str) -> str:
    return f"{path} cannot be found: the light is rendered without a profile."


def ies_profile(asset: Sdf.AssetPath, path: str, ctx: Context) -> IesProfile | None:
    """The profile; None where it cannot be had, which is noted for the light at `path`."""
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
    """What is wrong with it, where it is of no use."""
    try:
        content = read_asset(resolved, MAX_BYTES)
        return WHAT_IT_IS if is_pointer(content) else parse_ies(content)
    except IesError as error:
        return str(error)
    except AssetError as error:
        return error.message
