"""Bytes of an asset that Ar has resolved, also inside a package."""

from __future__ import annotations

from pxr import Ar, Tf

from ...errors import AssetError
from .messages import tf_message


def read_asset(path: str, most: int | None = None) -> bytes:
    """Return the asset's bytes; raise AssetError if it cannot be opened, or is larger than `most` bytes."""
    try:
        asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    except Tf.ErrorException as error:  # such as a compressed member of a package
        message = f"the asset cannot be opened: {tf_message(error)}"
        raise AssetError(message, where=path, code="asset-missing") from None
    if not asset:
        raise AssetError("the asset cannot be opened", where=path, code="asset-missing")
    with asset as opened:
        if most is not None and opened.GetSize() > most:
            raise AssetError(f"the asset has {opened.GetSize()} bytes, more than {most}", where=path, code="asset-missing")
        return bytes(opened.GetBuffer())
