"""Stages expanded by USD's own functions into plain prims, one an instance and shape: the oracle for all instancing.

Points and instances with velocities go where ComputePointsAtTime and ComputeInstanceTransformsAtTime say. The transforms of
other point instancers are put together with Gf from the authored arrays, since ComputeInstanceTransformsAtTime does not make
half quaternions unit length and primray does.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import Gf, Usd, UsdGeom

from primray.description import Curves, Doubles, Placement, SceneDescription, Sphere, SubdivisionMesh

SHAPES = ("Mesh", "Sphere", "Cube", "Cone", "Cylinder", "Capsule", "Plane", "Points", "BasisCurves")
_DRAWN = Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier & ~Usd.PrimIsAbstract
_NOT_COPIED = ("xformOp", "visibility", "purpose", "proxyPrim", "extent", "primvars:", "velocities", "accelerations")

Place = tuple[Usd.Prim, Gf.Matrix4d]


def places(stage: Usd.Stage, time: Usd.TimeCode) -> list[Place]:
    """All visible shapes of purpose default and render with their world matrices, one prim at a time."""
    children = stage.GetPseudoRoot().GetFilteredChildren(Usd.PrimDefaultPredicate)
    return [place for child in children for place in _visit(child, Gf.Matrix4d(1), "default", time)]


def _visit(
    prim: Usd.Prim, parent: Gf.Matrix4d, purpose: str, time: Usd.TimeCode, own: Gf.Matrix4d | None = None
) -> Iterator[Place]:
    """`own`: the matrix of a prototype's root, which is not its parent's."""
    imageable = UsdGeom.Imageable(prim)
    if imageable and imageable.GetVisibilityAttr().Get(time) == "invisible":
        return
    if imageable and imageable.GetPurposeAttr().HasAuthoredValue():
        purpose = imageable.GetPurposeAttr().Get()
    xformable = UsdGeom.Xformable(prim)
    local = xformable.GetLocalTransformation(time) if xformable else Gf.Matrix4d(1)
    world = own if own is not None else local * parent
    if prim.IsA(UsdGeom.PointInstancer):
        yield from _visit_points(UsdGeom.PointInstancer(prim), world, purpose, time)
        return
    if str(prim.GetTypeName()) in SHAPES and purpose in ("default", "render"):
        yield prim, world
    for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies(_DRAWN)):
        yield from _visit(child, world, purpose, time)


def _visit_points(instancer: UsdGeom.PointInstancer, world: Gf.Matrix4d, purpose: str, time: Usd.TimeCode) -> Iterator[Place]:
    indices = instancer.GetProtoIndicesAttr().Get(time)
    mask = instancer.ComputeMaskAtTime(time)
    if len(instancer.GetPositionsAttr().Get(time) or []) != len(indices or []):
        return
    moved = _moved(instancer, time)
    stage = instancer.GetPrim().GetStage()
    roots = [stage.GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetForwardedTargets()]
    for i, index in enumerate(indices or []):
        if (mask and not mask[i]) or not 0 <= index < len(roots) or not (roots[index] and roots[index].IsActive()):
            continue
        root = UsdGeom.Xformable(roots[index])
        local = root.GetLocalTransformation(time) if root else Gf.Matrix4d(1)
        instance = moved[i] if moved else _instance(instancer, i, time)
        yield from _visit(roots[index], Gf.Matrix4d(1), purpose, time, own=local * instance * world)


def _moved(instancer: UsdGeom.PointInstancer, time: Usd.TimeCode) -> list[Gf.Matrix4d]:
    """By velocities; empty where there are none."""
    rates = (instancer.GetVelocitiesAttr(), instancer.GetAngularVelocitiesAttr())
    if time.IsDefault() or not any(rate.HasAuthoredValue() for rate in rates):
        return []
    exclude, all_of_them = UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    return list(instancer.ComputeInstanceTransformsAtTime(time, time, exclude, all_of_them))


def _instance(instancer: UsdGeom.PointInstancer, i: int, time: Usd.TimeCode) -> Gf.Matrix4d:
    """Scale, then rotation, then translation (UsdGeomPointInstancer, "Computing an Instance Transform"; row vectors)."""
    positions = instancer.GetPositionsAttr().Get(time)
    matrix = Gf.Matrix4d(1)
    if scales := instancer.GetScalesAttr().Get(time):
        matrix *= Gf.Matrix4d(1).SetScale(Gf.Vec3d(scales[i]))
    quaternions = instancer.GetPrim().GetAttribute("orientationsf").Get(time) or instancer.GetOrientationsAttr().Get(time)
    if quaternions:
        matrix *= Gf.Matrix4d(1).SetRotate(Gf.Quatd(quaternions[i]).GetNormalized())
    return matrix * Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(positions[i]))


def flat_stage(stage: Usd.Stage, time: Usd.TimeCode) -> Usd.Stage:
    """The same shapes as prims of their own, all at the root, without instances."""
    flat = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(flat, UsdGeom.GetStageUpAxis(stage))
    UsdGeom.SetStageMetersPerUnit(flat, UsdGeom.GetStageMetersPerUnit(stage))
    for i, (prim, world) in enumerate(places(stage, time)):
        copy = flat.DefinePrim(f"/shape_{i}", prim.GetTypeName())
        for attribute in prim.GetAuthoredAttributes():
            value = _value(prim, attribute, time)
            if value is not None and not attribute.GetName().startswith(_NOT_COPIED):
                made = copy.CreateAttribute(attribute.GetName(), attribute.GetTypeName())
                made.Set(value)
                if attribute.HasAuthoredMetadata("interpolation"):
                    made.SetMetadata("interpolation", attribute.GetMetadata("interpolation"))
        color = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        if color and color.HasValue():
            primvar = UsdGeom.PrimvarsAPI(copy).CreatePrimvar("displayColor", color.GetTypeName(), color.GetInterpolation())
            primvar.Set(color.ComputeFlattened(time))
        UsdGeom.Xformable(copy).AddTransformOp().Set(world)
    return flat


def _value(prim: Usd.Prim, attribute: Usd.Attribute, time: Usd.TimeCode) -> object:
    points = UsdGeom.PointBased(prim)
    if attribute.GetName() == "points" and points.GetVelocitiesAttr().HasAuthoredValue() and not time.IsDefault():
        return points.ComputePointsAtTime(time, time)
    return attribute.Get(time)


def world_triangles(d: SceneDescription) -> Doubles:
    """(T, 3, 3): every triangle as placed in the world; of a sphere two that show its centre and axes."""
    shapes = [_triangles_of(shape) for shape in d.shapes]
    found = [shapes[p.shape] @ p.matrix[:3, :3].T + p.matrix[:3, 3] for p in d.static]
    prototypes = [np.zeros((0, 3, 3))] * len(d.prototypes)
    for nested in (False, True):  # prototypes of placements place those of shapes
        for k, prototype in enumerate(d.prototypes):
            if bool(prototype.placements) == nested:
                own = [shapes[p.shape] @ p.matrix[:3, :3].T + p.matrix[:3, 3] for p in prototype.shapes]
                own += [_placed(placement, prototypes[placement.prototype]) for placement in prototype.placements]
                prototypes[k] = np.concatenate(own)
    found += [_placed(placement, prototypes[placement.prototype]) for placement in d.placements]
    return np.concatenate(found) if found else np.zeros((0, 3, 3))


def _placed(placement: Placement, triangles: Doubles) -> Doubles:
    rows = np.concatenate(list(placement.chunks()))
    at = np.einsum("kij,tvj->ktvi", rows[:, :, :3], triangles) + rows[:, None, None, :, 3]
    return at.reshape(-1, 3, 3)


def _triangles_of(shape: object) -> Doubles:
    if isinstance(shape, Sphere):
        x, y, z = np.eye(3) * shape.radius
        return np.array([[np.zeros(3), x, y], [np.zeros(3), y, z]])
    if isinstance(shape, Curves):  # its control points, three by three
        starts = np.arange(len(shape.controls) - 2)
        return shape.controls[starts[:, None] + np.arange(3), :3].astype(np.float64)
    if isinstance(shape, SubdivisionMesh):  # a fan over each face of the cage
        first = np.cumsum(shape.face_counts) - shape.face_counts
        fans = [(a, a + k, a + k + 1) for a, n in zip(first, shape.face_counts, strict=True) for k in range(1, n - 1)]
        return shape.points.astype(np.float64)[shape.face_points[np.array(fans)]]
    return shape.points[shape.triangles].astype(np.float64)  # type: ignore[attr-defined]


def assert_same_triangles(a: Doubles, b: Doubles, tolerance: float) -> None:
    """As sets, to `tolerance` of the largest coordinate: sorted projections on random directions agree."""
    assert a.shape == b.shape
    scale = max(1e-30, float(np.abs(b).max(initial=0.0)))
    directions = np.random.default_rng(0).normal(size=(9, 8)) / 3
    found, expected = (np.sort(x.reshape(-1, 9) @ directions, axis=0) for x in (a, b))
    assert np.abs(found - expected).max(initial=0.0) <= tolerance * scale
