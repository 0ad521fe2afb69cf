"""Skeletons and the meshes they move below a SkelRoot, found by USD's own cache, also in instances; and marks on meshes with
joint weights that say whether skinning posed them, or why not.

Marks are metadata in the session layer of the posed stage copy, so that instances have them, too; the traversal reports them.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pxr import Sdf, Usd

from ..stage.reads import computed, targets, type_name
from ..stage.traversal import EXISTING_IN_INSTANCES

if TYPE_CHECKING:
    from pxr import UsdSkel  # imported only for stages with skeletons: it takes as long as starting Python


@dataclass(kw_only=True)
class SkeletonBinding:
    skeleton: Usd.Prim
    animation: Usd.Prim  # may be in an instance; invalid if there is none
    joints: list[str]
    poses: UsdSkel.SkeletonQuery
    query: UsdSkel.AnimQuery
    targets: list[UsdSkel.SkinningQuery]


def bindings_below(root: UsdSkel.Root) -> list[SkeletonBinding]:
    from pxr import UsdSkel

    cache = UsdSkel.Cache()
    if not cache.Populate(root, EXISTING_IN_INSTANCES):
        return []
    return [_binding(cache, found) for found in cache.ComputeSkelBindings(root, EXISTING_IN_INSTANCES)]


def _binding(cache: UsdSkel.Cache, found: UsdSkel.Binding) -> SkeletonBinding:
    from pxr import UsdSkel

    query = cache.GetSkelQuery(found.GetSkeleton())
    prim = found.GetSkeleton().GetPrim()
    animation = UsdSkel.BindingAPI(prim).GetInheritedAnimationSource()
    joints = list(query.GetJointOrder() or ()) if query else []
    return SkeletonBinding(
        skeleton=prim,
        animation=animation,
        joints=joints,
        poses=query,
        query=query.GetAnimQuery(),
        targets=list(found.GetSkinningTargets()),
    )


def prims_of_binding(binding: SkeletonBinding) -> list[Usd.Prim]:
    """Return the skeleton, its animation and the prims that it moves."""
    moved = [query.GetPrim() for query in binding.targets if query.HasJointInfluences() or query.HasBlendShapes()]
    return [prim for prim in (binding.skeleton, binding.animation, *moved) if prim]


def lacks_animation(binding: SkeletonBinding) -> str:
    """Return why the bound animation moves nothing; "" if it does, or if none is bound and the skeleton is in its rest pose.

    Reads held values, which are those at the default time.
    """
    if not binding.animation:
        bound = targets(binding.skeleton, "skel:animationSource")
        return f"its animation {bound[0]} does not exist" if bound else ""
    path, query = binding.animation.GetPath(), binding.query
    if not query:
        return f"its animation {path} is not a SkelAnimation"
    if query.ComputeBlendShapeWeights(Usd.TimeCode.Default()):
        return ""
    if not query.ComputeJointLocalTransforms(Usd.TimeCode.Default()):
        return f"its animation {path} is empty"
    return (
        "" if set(query.GetJointOrder()) & set(binding.joints) else f"its animation {path} moves none of its skeleton's joints"
    )


JOINT_WEIGHTS = "primvars:skel:jointWeights"
NOT_APPLIED = "SkelBindingAPI is not applied to it"
UNBOUND = "no Skeleton is bound to it (skel:skeleton)"
_MARK_KEY = "primray:unposed"  # reason; "" if posed


def mark_posing(prim: Usd.Prim, why_unposed: str = "") -> None:
    """Mark a prim of a stage copy as posed or with the reason why not; on a SkelRoot, as visited."""
    prim.SetCustomDataByKey(_MARK_KEY, why_unposed)


def has_mark(prim: Usd.Prim) -> bool:
    return _mark_of(prim) is not None


def _mark_of(prim: Usd.Prim) -> Any:
    """Return the mark; None if there is none or customData is not a dictionary."""
    return computed(lambda: prim.GetCustomDataByKey(_MARK_KEY), None)


def copy_marks(source: Sdf.PrimSpec, target: Sdf.PrimSpec) -> None:
    """Copy the customData with the marks from one prim spec to another."""
    for key, datum in source.customData.items():
        target.customData[key] = datum


def has_weights(prim: Usd.Prim) -> bool:
    attribute = prim.GetAttribute(JOINT_WEIGHTS)
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
        if type_name(prim) == "SkelRoot" or has_mark(prim):
            return True
        prim = prim.GetParent()
    return False
