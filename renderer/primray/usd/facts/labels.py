"""Semantic labels of prims: UsdSemantics' LabelsAPI, and the attributes that Omniverse used before it.

As UsdSemanticsLabelsQuery computes them with inheritance, the labels of a prim are its own and those of all prims above it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from pxr import Sdf, Usd

from ..querying.guarded import property_names
from ..resolving.read import When, read, when_of_few
from .names_in_instances import instance_above

_INDICES = re.compile(r"\[\d+\]")  # of a point instancer's instances
NAMESPACE = "semantics:labels:"
OLD, TYPE, DATA = "semantic:", ":params:semanticType", ":params:semanticData"


def labels_of(stage: Usd.Stage, prim: str, instance: str, taxonomy: str, time_code: float | None) -> tuple[str, ...]:
    """Return inherited labels in one taxonomy, sorted, of the prim at a path and of the instance in which it is seen ("": in
    none).

    The prim's path may be that in another instance, whose own labels do not count.
    """
    when = when_of_few(time_code)
    place = _INDICES.sub("", instance)
    prefixes = _prefixes(prim)
    if place and prefixes and (found := stage.GetPrimAtPath(prefixes[-1])) and stage.GetPrimAtPath(place):
        shared = instance_above(found)
        prefixes = [path for path in prefixes if shared is None or not shared.GetPath().HasPrefix(path)]
    labels: set[str] = set()
    for path in dict.fromkeys([*prefixes, *_prefixes(place)]):
        if found := stage.GetPrimAtPath(path):
            labels.update(_own(found, taxonomy, when))
    return tuple(sorted(labels))


def _prefixes(path: str) -> list[Sdf.Path]:
    """Return the paths of a prim and of its ancestors; none for an invalid path."""
    is_path = Sdf.Path.IsValidPathString(path) and path.startswith("/")
    return list(Sdf.Path(path).GetPrimPath().GetPrefixes()) if is_path else []


def _own(prim: Usd.Prim, taxonomy: str, when: When) -> Iterator[str]:
    yield from (str(label) for label in read(prim, NAMESPACE + taxonomy, when) or ())
    for name in property_names(prim):
        if name.startswith(OLD) and name.endswith(TYPE) and str(read(prim, name, when)) == taxonomy:
            label = read(prim, name.removesuffix(TYPE) + DATA, when)
            if label:
                yield str(label)
