"""Marks on meshes with joint weights that say whether skinning posed them, or why not, for the traversal to report.

Marks are metadata in the session layer of the posed stage copy, so that instances have them, too.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from pxr import Sdf, Usd

from ..stage.reads import computed, type_name

WEIGHTS = "primvars:skel:jointWeights"
NOT_APPLIED = "SkelBindingAPI is not applied to it"
UNBOUND = "no Skeleton is bound to it (skel:skeleton)"
_MARK = "primray:unposed"  # reason; "" if posed


def mark(prim: Usd.Prim, why_unposed: str = "") -> None:
    """Mark a prim of a stage copy as posed or with the reason why not; on a SkelRoot, as visited."""
    prim.SetCustomDataByKey(_MARK, why_unposed)


def is_marked(prim: Usd.Prim) -> bool:
    return _mark_of(prim) is not None


def _mark_of(prim: Usd.Prim) -> Any:
    """Return the mark; None if there is none or customData is not a dictionary."""
    return computed(lambda: prim.GetCustomDataByKey(_MARK), None)


def copy_marks(source: Sdf.PrimSpec, target: Sdf.PrimSpec) -> None:
    """Copy the customData with the marks from one prim spec to another."""
    for key, datum in source.customData.items():
        target.customData[key] = datum


def has_weights(prim: Usd.Prim) -> bool:
    attribute = prim.GetAttribute(WEIGHTS)
    return bool(attribute and attribute.HasAuthoredValue())


def why_unposed(prim: Usd.Prim, shown: Usd.Prim, schemas: Collection[str]) -> str:
    """Return why a mesh with joint weights was not posed; "" if it was, or if that was already reported. `shown` is the mesh in
    the world, of which `prim` may be the prototype.

    Instances that keep their authored pose are reported by skinning itself (walking.skinned_instances).
    """
    marked = _mark_of(prim)
    if marked is not None:
        return str(marked)
    if not _is_below_root(shown):
        return "there is no SkelRoot above it"
    if "SkelBindingAPI" not in schemas:
        return NOT_APPLIED
    from pxr import UsdSkel  # takes as long to import as starting Python

    is_bound = computed(lambda: bool(UsdSkel.BindingAPI(shown).GetInheritedSkeleton()), False)
    return "" if is_bound else UNBOUND


def _is_below_root(prim: Usd.Prim) -> bool:
    while prim and not prim.IsPseudoRoot():
        if type_name(prim) == "SkelRoot" or is_marked(prim):
            return True
        prim = prim.GetParent()
    return False
