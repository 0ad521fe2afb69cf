"""Prims taken out of a stage that is a render's own, by its session layer; what refers to them stays."""

from __future__ import annotations

from collections.abc import Collection

from pxr import Sdf, Usd

from ..querying.traversal import drawn_in_instances

MOST_ARCS = 8  # references to references


def take_out(stage: Usd.Stage, paths: Collection[Sdf.Path]) -> None:
    """These prims, with all that is below them; in native instances they are named by their proxies."""
    gone = topmost(paths)
    if not gone:
        return
    members = frozenset(gone)
    kept = {path for path in _there(stage) if path not in members and not _has_above(path, members)}
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for _ in range(MOST_ARCS):
            here = _there(stage)
            there, lost = [path for path in gone if path in here], topmost(kept - here)
            if not there and not lost:
                break
            for path in lost:
                editable(stage, path).SetActive(True)
            for path in there:
                if stage.GetPrimAtPath(path):
                    editable(stage, path).SetActive(False)


def editable(stage: Usd.Stage, path: Sdf.Path) -> Usd.Prim:
    """What is in an instance is shared: the instances around it become prims of their own."""
    prim = stage.GetPrimAtPath(path)
    while prim.IsInstanceProxy():
        for above in path.GetPrefixes():
            instance = stage.GetPrimAtPath(above)
            if instance.IsInstance() and not instance.IsInstanceProxy():
                instance.SetInstanceable(False)
                break
        prim = stage.GetPrimAtPath(path)
    return prim


def topmost(paths: Collection[Sdf.Path]) -> list[Sdf.Path]:
    """Those that none of the others is above, in order; never the root of all."""
    among = frozenset(paths)
    return [path for path in sorted(among) if path != Sdf.Path.absoluteRootPath and not _has_above(path, among)]


def _has_above(path: Sdf.Path, paths: frozenset[Sdf.Path]) -> bool:
    return any(above in paths for above in path.GetPrefixes()[:-1])


def _there(stage: Usd.Stage) -> set[Sdf.Path]:
    return {prim.GetPath() for prim in drawn_in_instances(stage.GetPseudoRoot())}
