"""Marks on models of native instances, so that they stay models where the instance is ended in a copy of the stage.

USD treats the root of a prototype as a group of models (UsdPrim::IsModel), whatever is above its instances. Below an ended
instance that is no such group the same prims would not be models, and would be drawn whatever their draw modes are.
"""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Sdf, Usd

from .traversal import models_in

MODEL = "primray:model"


def models_below(instance: Usd.Prim) -> list[Sdf.Path]:
    """Return the paths of the models in a native instance that would not be models if it were ended."""
    if instance.IsGroup():
        return []
    prototype = instance.GetPrototype()
    root = prototype.GetPath()
    return [prim.GetPath().ReplacePrefix(root, instance.GetPath()) for prim in models_in(prototype)]


def mark_models(stage: Usd.Stage, paths: Iterable[Sdf.Path]) -> None:
    for path in paths:
        stage.GetPrimAtPath(path).CreateAttribute(MODEL, Sdf.ValueTypeNames.Bool).Set(True)
