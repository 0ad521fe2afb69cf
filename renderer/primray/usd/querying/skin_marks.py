"""Which meshes with joint weights were posed, and why others were not: posing leaves marks for whoever passes them.

Marks are metadata in the session layer of the posed stage, a copy of ours, so that instances have them too.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from pxr import Sdf, Usd

from .guarded import computed, type_name

WEIGHTS = "primvars:skel:jointWeights"
NOT_APPLIED = "SkelBindingAPI is not applied to it"
UNBOUND = "no Skeleton is bound to it (skel:skeleton)"
_MARK = "primray:unposed"  # why; "" of what is posed


def mark(prim: Usd.Prim, why_unposed: str = "") -> None:
    """Note on a prim of a stage of ours whether skeletons posed it, or, on a SkelRoot, that they came by."""
    prim.SetCustomDataByKey(_MARK, why_unposed)


def is_marked(prim: Usd.Prim) -> bool:
    return _mark_of(prim) is not None


def _mark_of(prim: Usd.Prim) -> Any:
    """None where there is none, also where its customData are no dictionary."""
    return computed(lambda: prim.GetCustomDataByKey(_MARK), None)


def copy_marks(source: Sdf.PrimSpec, target: Sdf.PrimSpec) -> None:
    """With what else their customData say."""
    for key, datum in source.customData.items():
        target.customData[key] = datum


def has_weights(prim: Usd.Prim) -> bool:
    attribute = prim.GetAttribute(WEIGHTS)
    return bool(attribute and attribute.HasAuthoredValue())


def why_unposed(prim: Usd.Prim, shown: Usd.Prim, schemas: Collection[str]) -> str:
    """Of a mesh with weights, in a prototype perhaps, which `shown` is in the world; "" where it is posed or was told of.

    Posing tells itself of instances that it leaves as they are (walking.skinned_instances).
    """
    marked = _mark_of(prim)
    if marked is not None:
        return str(marked)
    if not _is_below_root(shown):
        return "there is no SkelRoot above it"
    if "SkelBindingAPI" not in schemas:
        return NOT_APPLIED
    from pxr import UsdSkel  # takes as long to import as Python itself

    is_bound = computed(lambda: bool(UsdSkel.BindingAPI(shown).GetInheritedSkeleton()), False)
    return "" if is_bound else UNBOUND


def _is_below_root(prim: Usd.Prim) -> bool:
    while prim and not prim.IsPseudoRoot():
        if type_name(prim) == "SkelRoot" or is_marked(prim):
            return True
        prim = prim.GetParent()
    return False
