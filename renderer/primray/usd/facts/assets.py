"""Which asset each prim belongs to: its instance, else the nearest component model above it, else what is at the root.

The stage is the one that was opened: an instance that a render has ended in its copy, to pose what is in it, is an asset, too.
"""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Sdf, Usd

from .names_in_instances import instance_above


def assets_of(stage: Usd.Stage, paths: Iterable[str]) -> dict[str, str]:
    """Paths of assets by paths of prims; a path that is no prim's is its own."""
    return {path: _asset_of(stage, path) for path in dict.fromkeys(paths)}


def _asset_of(stage: Usd.Stage, path: str) -> str:
    if not Sdf.Path.IsValidPathString(path):
        return path
    place = Sdf.Path(path).GetPrimPath()
    own = stage.GetPrimAtPath(place)
    if own and (instance := instance_above(own)) is not None:
        return str(instance.GetPath())
    above = list(place.GetPrefixes())
    for prefix in reversed(above):
        prim = stage.GetPrimAtPath(prefix)
        if prim and prim.IsModel() and not prim.IsGroup():
            return str(prefix)
    return str(above[0]) if above else path
