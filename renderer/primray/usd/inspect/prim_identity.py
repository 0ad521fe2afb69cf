"""Identity of prims for mattes: shared names in native instances, and assets.

An instance's prims have a path in each instance, and none of these is better than another: which of them a prototype is named
after depends on the order of prims and on the population mask. The place where a prim is defined does not: `/kind/ball` in the
stage's own layers, else `tree.usda</tree/leaf>`; with the instance's variants, `tree.usda</tree/leaf>{size=big}`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from pxr import Sdf, Usd

from ..stage.messages import FileNames, file_names
from ..stage.reads import FAILURES


def names_in_instances(
    stage: Usd.Stage, shapes: Iterable[str], materials: Iterable[str], instances: Collection[str]
) -> dict[str, str]:
    """Return shared names by path, where there is one; `instances` are the paths by which a translation named prototypes.

    A shape that is not below one of these has a path of its own, even if it is in an instance of the stage as it was opened.
    """
    files, own = file_names(stage), frozenset(stage.GetLayerStack())
    roots = frozenset(Sdf.Path(path) for path in instances if Sdf.Path.IsValidPathString(path))
    asked = [*(path for path in dict.fromkeys(shapes) if _is_below(path, roots)), *dict.fromkeys(materials)]
    found = ((path, _definition(stage, path, files, own)) for path in dict.fromkeys(asked))
    return {path: name for path, name in found if name}


def instance_above(prim: Usd.Prim) -> Usd.Prim | None:
    """Return the nearest native instance that holds the prim, if any does."""
    if not prim.IsInstanceProxy():
        return None
    above = prim.GetParent()
    while above and not above.IsInstance():
        above = above.GetParent()
    return above if above else None


def _is_below(path: str, roots: Collection[Sdf.Path]) -> bool:
    return Sdf.Path.IsValidPathString(path) and any(prefix in roots for prefix in Sdf.Path(path).GetPrefixes()[:-1])


def _definition(stage: Usd.Stage, path: str, files: FileNames, own: Collection[Sdf.Layer]) -> str:
    """Return where a prim in an instance is defined; "" for a prim in none, or without a definition."""
    prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) and path.startswith("/") else None
    instance = instance_above(prim) if prim else None
    if prim is None or instance is None:
        return ""
    try:
        specs = [spec for spec in prim.GetPrimStack() if spec.specifier == Sdf.SpecifierDef]
        sets = instance.GetVariantSets()
        chosen = ", ".join(f"{name}={sets.GetVariantSelection(name)}" for name in sorted(sets.GetNames()))
    except FAILURES:
        return ""
    if not specs:
        return ""
    place = str(specs[0].path.StripAllVariantSelections())
    name = place if specs[0].layer in own else f"{files.in_text(str(specs[0].layer.identifier))}<{place}>"
    return name + (f"{{{chosen}}}" if chosen else "")


def assets_of(stage: Usd.Stage, paths: Iterable[str]) -> dict[str, str]:
    """Return paths of assets by paths of prims: the instance, else the nearest component model above, else the root prim.

    A path without a prim is its own asset. The stage is the one that was opened: an instance that a render has ended in its
    copy, to pose its contents, is an asset too.
    """
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
