"""Which materials prims are bound to: for `primray doctor`, of shapes whose material came to nothing."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Usd, UsdShade

from ..querying.guarded import computed


def bound_materials(stage: Usd.Stage, paths: Iterable[str]) -> dict[str, str]:
    """By path, that of the material; shapes that are bound to none are left out. Subsets' own bindings are not looked at."""
    prims = [prim for prim in map(stage.GetPrimAtPath, paths) if prim]
    nothing: tuple[list[UsdShade.Material], list[Usd.Relationship]] = ([], [])
    materials, _ = computed(lambda: UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims), nothing)
    found = zip(prims, materials, strict=False)
    return {str(prim.GetPath()): str(material.GetPath()) for prim, material in found if material}
