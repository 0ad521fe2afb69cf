"""Bytes of an asset that Ar resolved, also from inside a package."""

from __future__ import annotations

from pxr import Ar

from ..errors import AssetError


def read_asset(path: str) -> bytes:
    """The asset's bytes; AssetError if it cannot be opened."""
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise AssetError("the asset cannot be opened", where=path, code="asset-missing")
    with asset as opened:
        return bytes(opened.GetBuffer())
