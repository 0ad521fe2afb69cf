"""What is drawn where with what: as pxr's own functions say of each prim, and as a description has it, to be compared.

A leaf is the name of its prim, its matrix to the world, its material's name, and what it reads: displayColor without one,
primvars:p with one. Names of prims are unique in a layer, so that a name and a place say which leaf of which instance it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Kind, Usd, UsdGeom, UsdShade

from primray.aovs import WIDE
from primray.description import Mesh, PrimvarInput, SceneDescription

from .random_namespaces import FALLBACK

SHAPES = frozenset({"Cube", "Sphere"})
PURPOSES = ("default", "render")
GREY = (0.18, 0.18, 0.18)
IN_WORLD = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
_LOADED = Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier
IN_PROTOTYPE = Usd.TraverseInstanceProxies(_LOADED & ~Usd.PrimHasClassSpecifier)

Leaf = tuple[str, tuple[float, ...], str, tuple[float, ...] | None]


@dataclass(frozen=True)
class Placed:
    """One instance of a point instancer: the prototype's root, and what the instancer is in itself."""

    instancer: Usd.Prim
    index: int
    root: Usd.Prim
    matrix: Gf.Matrix4d  # of the instance, to the world
    around: Placed | None

    @property
    def is_below(self) -> bool:
        return bool(self.root.GetPath().HasPrefix(self.instancer.GetPath()))


def leaves_by_usd(stage: Usd.Stage) -> list[Leaf]:
    found = [leaf for child in stage.GetPseudoRoot().GetFilteredChildren(IN_WORLD) for leaf in _visit(child, None)]
    return sorted(found, key=repr)


def _visit(prim: Usd.Prim, placed: Placed | None) -> Iterator[Leaf]:
    kind = str(prim.GetPrimTypeInfo().GetSchemaTypeName())
    if _is_replaced(prim):
        if _is_drawn(prim, placed):
            yield prim.GetName(), _matrix(_world(prim, placed)), "axes", None
        return
    if kind == "PointInstancer":
        yield from _visit_instances(UsdGeom.PointInstancer(prim), placed)
        return
    if kind in SHAPES and _is_drawn(prim, placed):
        yield _leaf(prim, placed)
    for child in prim.GetFilteredChildren(IN_PROTOTYPE if placed else IN_WORLD):
        yield from _visit(child, placed)


def _visit_instances(instancer: UsdGeom.PointInstancer, around: Placed | None) -> Iterator[Leaf]:
    prim = instancer.GetPrim()
    roots = [prim.GetStage().GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetForwardedTargets()]
    world = _world(prim, around)
    for k, (index, at) in enumerate(
        zip(instancer.GetProtoIndicesAttr().Get(), instancer.GetPositionsAttr().Get(), strict=True)
    ):
        if roots[index] and roots[index].IsActive():
            matrix = Gf.Matrix4d().SetTranslate(Gf.Vec3d(at)) * world
            yield from _visit(roots[index], Placed(prim, k, roots[index], matrix, around))


def _leaf(prim: Usd.Prim, placed: Placed | None) -> Leaf:
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)
    read = _primvar(prim, "p" if material else "displayColor", placed)
    shown = read or (FALLBACK if material else GREY)
    return prim.GetName(), _matrix(_world(prim, placed)), str(material.GetPrim().GetName()) if material else "", shown


def _world(prim: Usd.Prim, placed: Placed | None) -> Gf.Matrix4d:
    if placed is None:
        return UsdGeom.XformCache().GetLocalToWorldTransform(prim)
    local, resets = UsdGeom.XformCache().GetLocalTransformation(prim)
    return local * (placed.matrix if resets or prim == placed.root else _world(prim.GetParent(), placed))


def _matrix(matrix: Gf.Matrix4d) -> tuple[float, ...]:
    return tuple(round(x, 3) + 0.0 for row in matrix for x in list(row)[:3])


def _is_drawn(prim: Usd.Prim, placed: Placed | None) -> bool:
    imageable = UsdGeom.Imageable(prim)
    purpose = _purpose(prim, placed)
    if placed is None:
        hidden = imageable.ComputeEffectiveVisibility(purpose) == UsdGeom.Tokens.invisible if imageable else False
        return purpose in PURPOSES and not hidden
    return purpose in PURPOSES and _is_visible(prim, purpose, placed)


def _purpose(prim: Usd.Prim, placed: Placed | None) -> str:
    """By namespace, else that of the instancer."""
    while prim and not UsdGeom.Imageable(prim):
        prim = prim.GetParent()
    info = UsdGeom.Imageable(prim).ComputePurposeInfo() if prim else UsdGeom.Imageable.PurposeInfo()
    if info.isInheritable or placed is None:
        return str(info.purpose) if prim else "default"
    return _purpose(placed.instancer, placed.around)


def _is_visible(prim: Usd.Prim, purpose: str, placed: Placed) -> bool:
    """From the leaf up to the prototype's root, then from its instancer."""
    opinion = ""
    while True:
        imageable = UsdGeom.Imageable(prim)
        if imageable and imageable.GetVisibilityAttr().Get() == UsdGeom.Tokens.invisible:
            return False
        if not opinion and purpose == "render" and imageable and prim.HasAPI(UsdGeom.VisibilityAPI):
            attribute = UsdGeom.VisibilityAPI(prim).GetRenderVisibilityAttr()
            opinion = str(attribute.Get()) if attribute.HasAuthoredValue() else ""
        if prim == placed.root:
            break
        prim = prim.GetParent()
    if opinion == "invisible":
        return False
    left = "default" if opinion else purpose  # an opinion further up does not count any more
    if placed.around is None:
        return bool(UsdGeom.Imageable(placed.instancer).ComputeEffectiveVisibility(left) != UsdGeom.Tokens.invisible)
    return _is_visible(placed.instancer, left, placed.around)


def _is_replaced(prim: Usd.Prim) -> bool:
    model = UsdGeom.ModelAPI(prim)
    if not prim.IsModel() or model.ComputeModelDrawMode() != UsdGeom.Tokens.origin:
        return False
    applied = prim.GetAttribute("model:applyDrawMode")
    if applied and applied.HasAuthoredValue():
        return bool(applied.Get())
    return bool(Usd.ModelAPI(prim).IsKind(Kind.Tokens.component))


def _primvar(prim: Usd.Prim, name: str, placed: Placed | None) -> tuple[float, ...] | None:
    """A constant one, as cubes and spheres can show it."""
    if placed is None:
        return _constant(UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name))
    at = prim
    end = placed.instancer if placed.is_below else placed.root.GetParent()
    while at != end:
        own = UsdGeom.PrimvarsAPI(at).GetPrimvar(name)
        if own and own.HasAuthoredValue():
            return _constant(own)
        at = at.GetParent()
    above = placed.root.GetParent()
    if not placed.is_below and not above.IsPseudoRoot():
        found = UsdGeom.PrimvarsAPI(placed.root).FindPrimvarWithInheritance(name)
        if found and (value := _constant(found)) is not None:
            return value
    return _of_instance(name, placed)


def _of_instance(name: str, placed: Placed) -> tuple[float, ...] | None:
    """An instancer's value for one of its instances."""
    own = UsdGeom.PrimvarsAPI(placed.instancer).GetPrimvar(name)
    if own and own.HasAuthoredValue() and own.GetInterpolation() == "vertex" and own.GetTypeName() != "string":
        values, count = own.Get(), len(UsdGeom.PointInstancer(placed.instancer).GetPositionsAttr().Get())
        return _rounded(values[placed.index]) if len(values) == count else None
    return _primvar(placed.instancer, name, placed.around)


def _constant(primvar: UsdGeom.Primvar) -> tuple[float, ...] | None:
    if not primvar or not primvar.HasAuthoredValue() or primvar.GetInterpolation() != "constant":
        return None
    value = primvar.Get()
    return _rounded(value[0]) if not isinstance(value, str) and value is not None and len(value) else None


def _rounded(values: Any) -> tuple[float, ...]:
    return tuple(round(float(x), 4) for x in values)


def leaves_described(d: SceneDescription) -> list[Leaf]:
    found = [_described(d, d.shapes[one.shape], one.matrix, {}) for one in d.static]
    for placement in d.placements:
        rows = np.concatenate([*placement.chunks(), np.zeros((0, 3, 4))])
        for i, row in enumerate(rows):
            given = {p.name: p.values[i] for p in placement.primvars}
            world = np.vstack([row, (0, 0, 0, 1)])
            inner = d.prototypes[placement.prototype].shapes
            found += [_described(d, d.shapes[one.shape], world @ one.matrix, given) for one in inner]
    return sorted(found, key=repr)


def _described(d: SceneDescription, shape: Any, matrix: np.ndarray, given: dict[str, np.ndarray]) -> Leaf:
    surface = d.surfaces[int(np.max(shape.surface))]
    name, at = shape.path.rpartition("/")[2], tuple(round(x, 3) + 0.0 for x in matrix.T[:, :3].ravel().tolist())
    if isinstance(shape, Mesh) and len(shape.triangles) == 36:  # three bars
        return name, at, "axes", None
    own = {p.name.removeprefix(WIDE): p.values[0] for p in shape.primvars}
    if surface.path:
        read = own.get("p", given.get("p"))
        return name, at, surface.path.rpartition("/")[2], _rounded(FALLBACK if read is None else read)
    reads = next((reads for field, reads in surface.inputs if field == "diffuse_color"), None)
    if isinstance(reads, PrimvarInput):
        return name, at, "", _rounded(own.get(reads.name, given.get(reads.name, reads.fallback)))
    return name, at, "", _rounded(surface.diffuse_color)
