"""Materials of all shapes and instances; USD is asked once for each group of prims that must have the same binding.

Where no collection binds materials, a prim's material follows from the nearest prim with a direct binding: from that binding's
targets if it is the prim's own, else from the path of the ancestor that has it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

from pxr import Sdf, Usd, UsdShade

from ..scene.bindings import BINDING, Subset, binding_names, strengths_of, subsets_of
from ..scene.context import Context
from ..scene.inheritance import Binding, ResolvedPrim, as_bound, bind_materials, inner_or_outer
from ..scene.prim_kinds import PrimKind
from ..scene.schemas import OWN_MATERIAL
from ..stage.reads import computed, property_names, targets
from ..stage.traversal import find_below

HAVE_SUBSETS = frozenset({"Mesh", "TetMesh", "BasisCurves"})  # prim types
MAX_EXPRESSED = 1024  # instances that membership expressions may give prototypes of their own


def binding_key(kind: PrimKind, path: str, targets: list[list[Sdf.Path]], above: str) -> Hashable:
    """Return a key that is equal for prims with the same material, "" for those without.

    `above`: the path of the nearest ancestor with a direct binding.
    """
    if not kind.bindings:
        return above
    if not all(targets) or "MaterialBindingAPI" not in kind.schemas:  # USD has to resolve these bindings prim by prim
        return path
    return kind.bindings, tuple(map(tuple, targets)), above


@dataclass(eq=False)
class NativePrototype:
    """One object for each native prototype, compared by identity, since comparing prims is slow."""

    prim: Usd.Prim

    @cached_property
    def binds_inside(self) -> bool:
        """Whether a prim in it, or in instances in it, binds a material."""
        return _binds_inside(self.prim)


def _binds_inside(prototype: Usd.Prim) -> bool:
    return any(
        binding_names(frozenset(property_names(prim))) or (prim.IsInstance() and _binds_inside(prim.GetPrototype()))
        for prim in find_below(prototype)
    )


def bindings_of(
    instances: list[ResolvedPrim], prototypes: list[NativePrototype], by_collection: bool, ctx: Context
) -> list[Binding | None]:
    """Return the material binding of each instance; without collection bindings, equal ones are one object."""
    if by_collection:
        return bind_materials([as_bound(instance.prim, instance.inherited) for instance in instances], ctx.material_purposes)
    keys = [_key_inside(instance, prototype) for instance, prototype in zip(instances, prototypes, strict=True)]
    first = {key: instance for key, instance in zip(reversed(keys), reversed(instances), strict=True) if key}
    prims = [as_bound(instance.prim, instance.inherited) for instance in first.values()]
    found: dict[Hashable, Binding | None] = dict(zip(first, bind_materials(prims, ctx.material_purposes), strict=True))
    return [found.get(key) for key in keys]


def _key_inside(instance: ResolvedPrim, prototype: NativePrototype) -> Hashable:
    """Return the instance's `bound_alike` key, with its binding strengths where its prototype binds materials, too."""
    if isinstance(instance.bound_as, str) or not prototype.binds_inside:
        return _key_of(instance)
    return _key_of(instance), strengths_of(instance.prim, binding_names(instance.names))


def bound_individually(instances: list[ResolvedPrim], ctx: Context) -> list[bool]:
    """Return which instances are bound prim by prim, because collections that bind materials have members inside them."""
    bindings = ctx.findings.collection_bindings
    if not bindings.expressed and not bindings.has_members_below:
        return [False] * len(instances)
    # A collection bound inside a prototype has the prototype's paths, one bound outside of it has the stage's.
    paths = [{instance.prim.GetPath(), as_bound(instance.prim, instance.inherited).GetPath()} for instance in instances]
    expressed = [any(path.HasPrefix(at) for at in bindings.expressed for path in both) for both in paths]
    if sum(expressed) > MAX_EXPRESSED:
        message = (
            f"Each of {sum(expressed)} instances below it has one material as a whole: members inside instances are ignored."
        )
        for at in bindings.expressed:
            ctx.warn("binding-expression", ctx.shown(str(at)), message)
        expressed = [False] * len(paths)
    return [by or not both.isdisjoint(bindings.has_members_below) for both, by in zip(paths, expressed, strict=True)]


def bind_shapes(shapes: list[ResolvedPrim], by_collection: bool, ctx: Context) -> None:
    """Set the material and the subsets of every shape."""
    key_of: Callable[[ResolvedPrim], Hashable] = _prim_key if by_collection else _key_of
    asked: dict[Hashable, int] = {}
    prims: list[Usd.Prim] = []
    subsets: dict[str, list[Subset]] = {}
    for leaf in shapes:
        key = key_of(leaf)
        if key and key not in asked:
            asked[key] = len(prims)
            prims.append(as_bound(leaf.prim, leaf.inherited))
        if leaf.type_name in HAVE_SUBSETS and (place := _prim_key(leaf)) not in subsets:
            subsets[place] = subsets_of(as_bound(leaf.prim, leaf.inherited), ctx)
    for place, owned in subsets.items():
        for subset in owned:
            asked[place, subset.path] = len(prims)
            prims.append(subset.prim)
    bindings = bind_materials(prims, ctx.material_purposes) if prims else []
    for leaf in shapes:
        outer = leaf.inherited.outer
        key = key_of(leaf)
        leaf.material = _material(bindings[asked[key]] if key else None, outer)
        if OWN_MATERIAL in leaf.names:
            leaf.material = leaf.prim.GetStage().GetPrimAtPath(targets(leaf.prim, BINDING)[0])
        if leaf.type_name in HAVE_SUBSETS and (owned := subsets[place := _prim_key(leaf)]):
            leaf.subsets = tuple(replace(s, material=_material(bindings[asked[place, s.path]], outer)) for s in owned)


def _key_of(prim: ResolvedPrim) -> Hashable:
    """Return the prim's `bound_alike` key, with the instance whose proxy is queried, if any."""
    proxy = prim.inherited.proxy
    return (proxy, prim.bound_as) if proxy and prim.bound_as else prim.bound_as


def _prim_key(leaf: ResolvedPrim) -> str:
    """Return a key that is equal for the same prim in the same instance."""
    return leaf.inherited.proxy + leaf.path


def _material(inner: Binding | None, outer: Binding | None) -> Usd.Prim | None:
    """Return the material of the stronger of two bindings: inside a prototype, and of the instance."""
    binding = inner_or_outer(inner, outer)
    return binding.material if binding else None


def bound_materials(stage: Usd.Stage, paths: Iterable[str]) -> dict[str, str]:
    """Return material paths by prim path, without shapes that are bound to none, for `primray doctor`.

    Subsets' own bindings are ignored.
    """
    prims = [prim for prim in map(stage.GetPrimAtPath, paths) if prim]
    nothing: tuple[list[UsdShade.Material], list[Usd.Relationship]] = ([], [])
    materials, _ = computed(lambda: UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims), nothing)
    found = zip(prims, materials, strict=False)
    return {str(prim.GetPath()): str(material.GetPath()) for prim, material in found if material}
