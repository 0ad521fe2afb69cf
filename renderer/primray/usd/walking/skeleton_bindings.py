"""Skeletons and the meshes they move below a SkelRoot, found by USD's own cache, also in instances; and why a binding has no
pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pxr import Usd

from ..stage.reads import targets
from ..stage.traversal import EXISTING_IN_INSTANCES

if TYPE_CHECKING:
    from pxr import UsdSkel  # imported only for stages with skeletons: it takes as long as starting Python


@dataclass
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
    return SkeletonBinding(prim, animation, joints, query, query.GetAnimQuery(), list(found.GetSkinningTargets()))


def concerned(binding: SkeletonBinding) -> list[Usd.Prim]:
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
