"""Semantic labels of prims: UsdSemantics' LabelsAPI, and the attributes that Omniverse had before it.

As UsdSemanticsLabelsQuery computes them with inheritance: those of a prim are its own and those of all prims above it.
"""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Sdf, Usd

from ..querying.guarded import property_names, value_at

NAMESPACE = "semantics:labels:"
OLD, TYPE, DATA = "semantic:", ":params:semanticType", ":params:semanticData"


def labels_of(stage: Usd.Stage, path: str, taxonomy: str, time_code: float | None) -> tuple[str, ...]:
    """Inherited labels of the prim at a path in one taxonomy, sorted; none for what is no path."""
    if not Sdf.Path.IsValidPathString(path) or not path.startswith("/"):
        return ()
    time = Usd.TimeCode.Default() if time_code is None else Usd.TimeCode(time_code)
    found: set[str] = set()
    for prefix in Sdf.Path(path).GetPrimPath().GetPrefixes():
        prim = stage.GetPrimAtPath(prefix)
        if prim:
            found.update(_own(prim, taxonomy, time))
    return tuple(sorted(found))


def _own(prim: Usd.Prim, taxonomy: str, time: Usd.TimeCode) -> Iterator[str]:
    attribute = prim.GetAttribute(NAMESPACE + taxonomy)
    if attribute:
        yield from (str(label) for label in value_at(attribute, time) or ())
    for name in property_names(prim):
        if name.startswith(OLD) and name.endswith(TYPE) and str(value_at(prim.GetAttribute(name), time)) == taxonomy:
            data = prim.GetAttribute(name.removesuffix(TYPE) + DATA)
            label = value_at(data, time) if data else None
            if label:
                yield str(label)
