"""Prims taken out of a stage that is a render's own, by its session layer; what refers to them has to stay (reach checks)."""

from __future__ import annotations

from collections.abc import Collection

from pxr import Sdf, Usd

from .reach import end_instance


def take_out(stage: Usd.Stage, paths: Collection[Sdf.Path]) -> None:
    """These prims, with all that is below them; in native instances they are named by their proxies."""
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for path in topmost(paths):
            if stage.GetPrimAtPath(path):
                editable(stage, path).SetActive(False)


def editable(stage: Usd.Stage, path: Sdf.Path) -> Usd.Prim:
    """What is in an instance is shared: the instances around it become prims of their own."""
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
    """Those that none of the others is above, in order; never the root of all."""
    among = frozenset(paths)
    return [path for path in sorted(among) if path != Sdf.Path.absoluteRootPath and not _has_above(path, among)]


def _has_above(path: Sdf.Path, paths: frozenset[Sdf.Path]) -> bool:
    return any(above in paths for above in path.GetPrefixes()[:-1])
