"""Which asset each prim belongs to: the nearest component model above it, else what stands at the root of the stage."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Sdf, Usd


def assets_of(stage: Usd.Stage, paths: Iterable[str]) -> dict[str, str]:
    """Paths of assets by paths of prims; a path that is no prim's is its own."""
    return {path: _asset_of(stage, path) for path in dict.fromkeys(paths)}


def _asset_of(stage: Usd.Stage, path: str) -> str:
    if not Sdf.Path.IsValidPathString(path):
        return path
    place = Sdf.Path(path).GetPrimPath()
    above = list(place.GetPrefixes())
    for prefix in reversed(above):
        prim = stage.GetPrimAtPath(prefix)
        if prim and prim.IsModel() and not prim.IsGroup():
            return str(prefix)
    return str(above[0]) if above else path
