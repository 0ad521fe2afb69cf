"""Deactivation of prims in a render's own copy of a stage, in its session layer. Callers check what else is affected
(reach)."""

from __future__ import annotations

from collections.abc import Collection

from pxr import Sdf, Usd

from .reach import end_instance


def take_out(stage: Usd.Stage, paths: Collection[Sdf.Path]) -> None:
    """Deactivate these prims, and so everything below them; prims in native instances are named by their proxies."""
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for path in topmost(paths):
            if stage.GetPrimAtPath(path):
                editable(stage, path).SetActive(False)


def editable(stage: Usd.Stage, path: Sdf.Path) -> Usd.Prim:
    """Return the prim at a path so that it can be edited: native instances around it are made plain prims."""
    prim = stage.GetPrimAtPath(path)
    while prim.IsInstanceProxy():
        for above in path.GetPrefixes():
            instance = stage.GetPrimAtPath(above)
            if instance.IsInstance() and not instance.IsInstanceProxy():
                end_instance(instance)
                break
        prim = stage.GetPrimAtPath(path)
    return prim


def topmost(paths: Collection[Sdf.Path]) -> list[Sdf.Path]:
    """Return the paths without those below another one, in order; never the pseudo-root."""
    among = frozenset(paths)
    return [path for path in sorted(among) if path != Sdf.Path.absoluteRootPath and not _has_above(path, among)]


def _has_above(path: Sdf.Path, paths: frozenset[Sdf.Path]) -> bool:
    return any(above in paths for above in path.GetPrefixes()[:-1])
