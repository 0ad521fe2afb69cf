"""Temporary definition of prims below `class` or `over`, where USD computes neither poses nor bounds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from pxr import Sdf, Usd

from ..stage.traversal import is_in_world


@contextmanager
def standing_in_world(stage: Usd.Stage, paths: Iterable[str]) -> Iterator[None]:
    """Define these prims and their ancestors by opinions in the stage's session layer, and restore them on exit.

    The stage must be a copy that is ours to write to (scratch_copy). Prims in native prototypes cannot have opinions and are
    skipped.
    """
    layer = stage.GetSessionLayer()
    undefined = list(dict.fromkeys(path for prim in map(stage.GetPrimAtPath, paths) for path in _undefined(prim)))
    _specify(layer, undefined, Sdf.SpecifierDef)
    try:
        yield
    finally:
        _specify(layer, undefined, Sdf.SpecifierOver)


def _undefined(prim: Usd.Prim) -> list[Sdf.Path]:
    """Return the paths of the prim and its ancestors that are not defined."""
    if not prim or prim.IsInPrototype() or prim.IsInstanceProxy() or is_in_world(prim):
        return []
    stage = prim.GetStage()
    return [path for path in prim.GetPath().GetPrefixes() if stage.GetPrimAtPath(path).GetSpecifier() != Sdf.SpecifierDef]


def _specify(layer: Sdf.Layer, paths: list[Sdf.Path], specifier: Sdf.Specifier) -> None:
    with Sdf.ChangeBlock():
        for path in paths:
            Sdf.CreatePrimInLayer(layer, path).specifier = specifier
