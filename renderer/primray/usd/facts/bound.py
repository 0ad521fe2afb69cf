"""Bound materials of prims, for `primray doctor` to list shapes whose material could not be used."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Usd, UsdShade

from ..stage.reads import computed


def bound_materials(stage: Usd.Stage, paths: Iterable[str]) -> dict[str, str]:
    """Return material paths by prim path, without shapes that are bound to none; subsets' own bindings are ignored."""
    prims = [prim for prim in map(stage.GetPrimAtPath, paths) if prim]
    nothing: tuple[list[UsdShade.Material], list[Usd.Relationship]] = ([], [])
    materials, _ = computed(lambda: UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims), nothing)
    found = zip(prims, materials, strict=False)
    return {str(prim.GetPath()): str(material.GetPath()) for prim, material in found if material}
