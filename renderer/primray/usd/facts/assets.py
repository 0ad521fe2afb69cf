"""The asset that each prim belongs to: its instance, else the nearest component model above it, else its root prim.

The stage is the one that was opened: an instance that a render has ended in its copy, to pose its contents, is an asset too.
"""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Sdf, Usd

from .names_in_instances import instance_above


def assets_of(stage: Usd.Stage, paths: Iterable[str]) -> dict[str, str]:
    """Return paths of assets by paths of prims; a path without a prim is its own asset."""
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
