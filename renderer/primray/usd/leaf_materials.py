"""The materials of all shapes: USD is asked once for those that cannot but be bound alike.

Where no collection binds anything, what is bound follows from the nearest prim that binds: the shape itself, whose targets say
all, or one above it, whose path does.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import replace

from pxr import Sdf, Usd

from .bindings import Subset, is_collection, subsets_of
from .context import Context
from .prim_kinds import PrimKind
from .resolve import Binding, ResolvedPrim, as_bound, bind_materials, inner_or_outer

_SUBSETS = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier)


def bound_alike(kind: PrimKind, path: str, targets: list[list[Sdf.Path]], above: str) -> Hashable:
    """Equal for prims that have one material; "" for those that have none. `above`: the path of the nearest prim that binds."""
    if not kind.bindings:
        return above
    if not all(targets) or "MaterialBindingAPI" not in kind.schemas:  # of which USD has something to say, prim by prim
        return path
    return kind.bindings, tuple(map(tuple, targets)), above


def bind_leaves(shapes: list[ResolvedPrim], kinds: Iterable[PrimKind], ctx: Context) -> None:
    """Give every shape its material and subsets."""
    collections = any(is_collection(name) for kind in kinds for name in kind.bindings)
    key_of: Callable[[ResolvedPrim], Hashable] = _place if collections else _bound_as
    asked: dict[Hashable, int] = {}
    prims: list[Usd.Prim] = []
    subsets: dict[str, list[Subset]] = {}
    for leaf in shapes:
        key = key_of(leaf)
        if key and key not in asked:
            asked[key] = len(prims)
            prims.append(as_bound(leaf.prim, leaf.inherited))
        if leaf.type_name == "Mesh" and (place := _place(leaf)) not in subsets:
            subsets[place] = subsets_of(as_bound(leaf.prim, leaf.inherited), _SUBSETS, ctx)
    for place, owned in subsets.items():
        for subset in owned:
            asked[place, subset.path] = len(prims)
            prims.append(subset.prim)
    bindings = bind_materials(prims, ctx.material_purposes) if prims else []
    for leaf in shapes:
        outer = leaf.inherited.outer
        key = key_of(leaf)
        leaf.material = _material(bindings[asked[key]] if key else None, outer)
        if leaf.type_name == "Mesh" and (owned := subsets[place := _place(leaf)]):
            leaf.subsets = tuple(replace(s, material=_material(bindings[asked[place, s.path]], outer)) for s in owned)


def _bound_as(leaf: ResolvedPrim) -> Hashable:
    return leaf.bound_as


def _place(leaf: ResolvedPrim) -> str:
    """One for what is the same prim in the same instance."""
    return leaf.inherited.proxy + leaf.path


def _material(inner: Binding | None, outer: Binding | None) -> Usd.Prim | None:
    binding = inner_or_outer(inner, outer)
    return binding.material if binding else None
