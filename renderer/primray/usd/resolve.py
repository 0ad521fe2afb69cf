"""What a prim inherits: transform, visibility, purpose, bound material, constant primvars, in USD's own terms.

`descend` takes what a parent hands down to a child; `bind_materials` asks USD for the bindings of many prims at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

from pxr import Gf, Usd, UsdGeom, UsdShade

from ..description import Doubles
from .convert import matrix
from .read import When, read, time_of

_IDENTITY = Gf.Matrix4d(1.0)


@dataclass(frozen=True)
class Binding:
    """A bound material; `stronger`: it overrides what descendants bind."""

    material: Usd.Prim
    stronger: bool = False


@dataclass(frozen=True)
class Inherited:
    """What a prim hands down. `outer` is the binding of the instance whose prototype is being walked."""

    purpose: str = "default"
    outer: Binding | None = None
    color: Usd.Attribute | None = None  # the nearest constant primvars:displayColor above
    opacity: Usd.Attribute | None = None
    purpose_visibility: tuple[str, ...] = ()  # purposes hidden by VisibilityAPI


@dataclass(frozen=True)
class Subset:
    path: str
    prim: Usd.Prim
    material: Usd.Prim | None = None


@dataclass(frozen=True)
class ResolvedPrim:
    """A prim and what it inherits; `group_from_prim` leads to the world, or to the prototype's space inside one."""

    prim: Usd.Prim
    path: str
    type_name: str
    names: frozenset[str]  # authored properties
    gf_matrix: Gf.Matrix4d = field(compare=False)
    inherited: Inherited = field(compare=False)
    material: Usd.Prim | None = None
    subsets: tuple[Subset, ...] = ()

    @cached_property
    def group_from_prim(self) -> Doubles:
        return matrix(self.gf_matrix)


def local_matrix(prim: Usd.Prim, names: frozenset[str], when: When, cache: UsdGeom.XformCache) -> tuple[Gf.Matrix4d, bool]:
    """The prim's own transform and whether it resets the stack, with un-sampled defaults read at their earliest sample."""
    if "xformOpOrder" not in names:
        return _IDENTITY, False
    if not when.careful:
        local, resets = cache.GetLocalTransformation(prim)
        return local, resets
    xformable = UsdGeom.Xformable(prim)
    if not xformable:
        return _IDENTITY, False
    local = Gf.Matrix4d(1.0)
    for op in xformable.GetOrderedXformOps():  # least local first; row vectors: the most local multiplies from the left
        local = op.GetOpTransform(time_of(op.GetAttr(), when)) * local
    return local, xformable.GetResetXformStack()


def descend(parent: Inherited, prim: Usd.Prim, names: frozenset[str], when: When) -> Inherited | None:
    """What `prim` hands down, None if it is invisible (and so is all below it)."""
    if "visibility" in names and read(prim, "visibility", when) == "invisible":
        return None
    mine = parent
    if "purpose" in names:
        purpose = prim.GetAttribute("purpose")
        if purpose.HasAuthoredValue():
            mine = replace(mine, purpose=str(purpose.Get()))
    if "primvars:displayColor" in names:
        mine = replace(mine, color=_if_constant(prim, "primvars:displayColor", mine.color))
    if "primvars:displayOpacity" in names:
        mine = replace(mine, opacity=_if_constant(prim, "primvars:displayOpacity", mine.opacity))
    return mine


def _if_constant(prim: Usd.Prim, name: str, otherwise: Usd.Attribute | None) -> Usd.Attribute | None:
    """Only constant primvars are inherited (UsdGeomPrimvarsAPI)."""
    attribute = prim.GetAttribute(name)
    constant = UsdGeom.Primvar(attribute).GetInterpolation() == UsdGeom.Tokens.constant
    return attribute if constant and attribute.HasAuthoredValue() else otherwise


def bind_materials(prims: list[Usd.Prim], purposes: tuple[str, ...]) -> list[Binding | None]:
    """The material bound to each prim within its namespace: by the first purpose that gives one, last the general one."""
    found: list[Binding | None] = [None] * len(prims)
    for purpose in purposes:
        missing = [i for i, binding in enumerate(found) if binding is None]
        if not missing:
            break
        materials, rels = UsdShade.MaterialBindingAPI.ComputeBoundMaterials([prims[i] for i in missing], purpose)
        for i, material, rel in zip(missing, materials, rels, strict=True):
            if material:
                found[i] = Binding(material.GetPrim(), _is_stronger(rel))
    return found


def _is_stronger(rel: Usd.Relationship) -> bool:
    strength = UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(rel)
    return bool(strength == UsdShade.Tokens.strongerThanDescendants)


def inner_or_outer(inner: Binding | None, outer: Binding | None) -> Binding | None:
    """The binding inside a prototype, unless there is none or the instance's own is stronger than descendants'."""
    return outer if outer is not None and (inner is None or outer.stronger) else inner
