"""Semantic labels of prims: UsdSemantics' LabelsAPI, and the attributes that Omniverse had before it.

As UsdSemanticsLabelsQuery computes them with inheritance: those of a prim are its own and those of all prims above it.
"""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Sdf, Usd

from ..querying.guarded import property_names
from ..resolving.read import When, read, when_of_few

NAMESPACE = "semantics:labels:"
OLD, TYPE, DATA = "semantic:", ":params:semanticType", ":params:semanticData"


def labels_of(stage: Usd.Stage, path: str, taxonomy: str, time_code: float | None) -> tuple[str, ...]:
    """Inherited labels of the prim at a path in one taxonomy, sorted; none for what is no path."""
    if not Sdf.Path.IsValidPathString(path) or not path.startswith("/"):
        return ()
    when = when_of_few(time_code)
    found: set[str] = set()
    for prefix in Sdf.Path(path).GetPrimPath().GetPrefixes():
        prim = stage.GetPrimAtPath(prefix)
        if prim:
            found.update(_own(prim, taxonomy, when))
    return tuple(sorted(found))


def _own(prim: Usd.Prim, taxonomy: str, when: When) -> Iterator[str]:
    yield from (str(label) for label in read(prim, NAMESPACE + taxonomy, when) or ())
    for name in property_names(prim):
        if name.startswith(OLD) and name.endswith(TYPE) and str(read(prim, name, when)) == taxonomy:
            label = read(prim, name.removesuffix(TYPE) + DATA, when)
            if label:
                yield str(label)
