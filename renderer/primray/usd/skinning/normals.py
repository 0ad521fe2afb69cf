"""Normals of skinned shapes, in the form that USD's baking rotates with the joints, or rotated here where baking cannot do so.

Baking rotates `normals` per point or, for meshes, per corner. It does not rotate `primvars:normals` (which take precedence),
nor uniform or constant `normals`: these are converted. Curves may have one normal per segment end, which are fewer than the
points, and a TetMesh several at a point: these are rotated by the joints of their point (UsdSkel.SkinNormals).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from pxr import Gf, Usd, UsdGeom, Vt

from ..curves.bezier import BEZIER, basis_curves
from ..mesh.tet_mesh import surface_of
from ..stage.reads import default_value, interpolation, normals_interpolation, world_transform
from ..stage.values import array
from .bindings import SkeletonBinding

if TYPE_CHECKING:
    from pxr import UsdSkel


Vectors = npt.NDArray[np.float32]
_SINGLE_VECTORS = (Gf.Vec3h, Gf.Vec3f, Gf.Vec3d)
_VECTOR_ARRAYS = (Vt.Vec3hArray, Vt.Vec3fArray, Vt.Vec3dArray)


def make_bakeable(prim: Usd.Prim) -> None:
    """Author a shape's normals in the form that baking rotates, at the stage's edit target; by now none of them vary over time.

    Normals that do not fit the shape are left as they are; the adapter that reads it reports them.
    """
    shape = UsdGeom.PointBased(prim)
    if not shape or _has_limit_surface(prim):
        return
    values, given, attribute = authored_normals(prim)
    if attribute.GetName() == "normals" and given not in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.constant):
        return
    if _author(shape, values, given) and attribute.GetName() != "normals":
        attribute.Block()


def _has_limit_surface(prim: Usd.Prim) -> bool:
    """Return whether the mesh is a subdivision surface, whose normals are those of its limit surface."""
    mesh = UsdGeom.Mesh(prim)
    return bool(mesh) and default_value(mesh.GetSubdivisionSchemeAttr()) != UsdGeom.Tokens.none


def authored_normals(prim: Usd.Prim) -> tuple[Vectors | None, str, Usd.Attribute]:
    """Return the normals in effect with indices applied, their interpolation, and their attribute."""
    primvar = UsdGeom.Primvar(prim.GetAttribute("primvars:normals"))
    if primvar and primvar.HasAuthoredValue():
        return _flattened(primvar), interpolation(primvar), primvar.GetAttr()
    shape = UsdGeom.PointBased(prim)
    return vectors(shape.GetNormalsAttr()), normals_interpolation(shape), shape.GetNormalsAttr()


def _flattened(primvar: UsdGeom.Primvar) -> Vectors | None:
    """Return the values with indices applied; None if indices are out of range, which would make USD print its own error."""
    values = vectors(primvar.GetAttr())
    if values is None or not primvar.IsIndexed():
        return values
    indices = integers(primvar.GetIndicesAttr())
    return values[indices] if ((indices >= 0) & (indices < len(values))).all() else None


def vectors(attribute: Usd.Attribute) -> Vectors | None:
    """Return a vector attribute as (N, 3), or None for other types."""
    values = default_value(attribute)
    if isinstance(values, _SINGLE_VECTORS):
        values = [values]
    elif not isinstance(values, _VECTOR_ARRAYS):
        return None
    return np.asarray(values, np.float32).reshape(-1, 3)


def integers(attribute: Usd.Attribute, columns: int = 1) -> npt.NDArray[np.int64]:
    """Return an integer attribute as (N,) or (N, columns); empty for other types."""
    values = array(default_value(attribute), columns, "i")
    none = np.zeros(0 if columns == 1 else (0, columns), np.int64)
    return none if values is None else values.astype(np.int64)


def rows_or_empty(values: Vectors | None) -> Vectors:
    return np.zeros((0, 3), np.float32) if values is None else values


def _author(shape: UsdGeom.PointBased, values: Vectors | None, given: str) -> bool:
    mesh = UsdGeom.Mesh(shape)
    made = None if values is None else _per_point_or_corner(mesh, values, given) if mesh else _per_point(shape, values, given)
    if made is None:
        return False
    shape.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(made))
    per_corner = mesh and given in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.faceVarying)
    per_end = not mesh and given == UsdGeom.Tokens.varying  # on curves: linear between segment ends, whatever the basis
    kind = UsdGeom.Tokens.varying if per_end else UsdGeom.Tokens.vertex
    shape.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if per_corner else kind)
    return True


def _per_point(shape: UsdGeom.PointBased, values: Vectors, given: str) -> Vectors | None:
    """Return the normals per point (N, 3) of a shape other than a mesh; None if they do not fit or cannot be given per
    point."""
    count = len(rows_or_empty(vectors(shape.GetPointsAttr())))
    if given == UsdGeom.Tokens.constant:
        return np.repeat(values, count, axis=0) if len(values) == 1 else None
    if given == UsdGeom.Tokens.uniform:
        curves = UsdGeom.Curves(shape)
        sizes = integers(curves.GetCurveVertexCountsAttr()) if curves else np.zeros(0, np.int64)
        fits = len(values) == len(sizes) and (sizes >= 0).all() and sizes.sum() == count
        return np.repeat(values, sizes, axis=0) if fits else None
    return values if given in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(values) == count else None


def _per_point_or_corner(mesh: UsdGeom.Mesh, values: Vectors, given: str) -> Vectors | None:
    """Return the normals (N, 3) per point, or per corner if they were uniform or faceVarying; None if their number does not fit
    the mesh."""
    points, corners = vectors(mesh.GetPointsAttr()), len(integers(mesh.GetFaceVertexIndicesAttr()))
    sizes, count = integers(mesh.GetFaceVertexCountsAttr()), 0 if points is None else len(points)
    expected = {UsdGeom.Tokens.constant: 1, UsdGeom.Tokens.uniform: len(sizes), UsdGeom.Tokens.faceVarying: corners}
    if len(values) != expected.get(given, count):
        return None
    if given == UsdGeom.Tokens.constant:
        return np.repeat(values, count, axis=0)
    if given == UsdGeom.Tokens.uniform:
        return np.repeat(values, sizes, axis=0) if (sizes >= 0).all() and sizes.sum() == corners else None
    return values


Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class UnbakedNormals:
    """Normals of one shape, each with the index of its point."""

    binding: SkeletonBinding
    query: UsdSkel.SkinningQuery
    values: Vectors  # (N, 3)
    points: Numbers  # (N,)
    interpolation: str

    def at(self, time: Usd.TimeCode) -> Vt.Vec3fArray | None:
        """Return the normals rotated by the skeleton at a time, in the shape's own space; None if USD has no pose."""
        from pxr import UsdSkel

        found = self.query.ComputeVaryingJointInfluences(self._count(), time)
        poses = self.binding.poses.ComputeSkinningTransforms(time)
        if not found or not poses:
            return None
        width = self.query.GetNumInfluencesPerComponent()
        indices, weights = (np.array(each).reshape(-1, width)[self.points].ravel() for each in found)
        names = self.query.GetJointOrder() or self.binding.joints
        by_name = dict(zip(self.binding.joints, map(_normal_matrix, poses), strict=False))
        joints = [by_name.get(name, Gf.Matrix3d(1)) for name in names]
        if not len(joints) or indices.min(initial=0) < 0 or indices.max(initial=0) >= len(joints):
            return None
        normals = Vt.Vec3fArray.FromNumpy(self.values)
        method, bound = self.query.GetSkinningMethod(), _normal_matrix(self.query.GetGeomBindTransform(time))
        UsdSkel.SkinNormals(
            method,
            bound,
            Vt.Matrix3dArray(joints),
            Vt.IntArray.FromNumpy(indices),
            Vt.FloatArray.FromNumpy(weights),
            width,
            normals,
        )
        return _in_space(normals, self._from_skeleton(time))

    def _from_skeleton(self, time: Usd.TimeCode) -> Gf.Matrix4d:
        cache = UsdGeom.XformCache(time)
        skeleton, shape = (world_transform(cache, prim) for prim in (self.binding.skeleton, self.query.GetPrim()))
        return Gf.Matrix4d(1) if skeleton is None or shape is None else skeleton * shape.GetInverse()

    def _count(self) -> int:
        points = vectors(UsdGeom.PointBased(self.query.GetPrim()).GetPointsAttr())
        return 0 if points is None else len(points)


def take_unbaked_normals(binding: SkeletonBinding, query: UsdSkel.SkinningQuery) -> UnbakedNormals | None:
    """Return the normals that baking would ignore or reject, and block their attribute at the stage's edit target; None if
    there are none."""
    prim = query.GetPrim()
    shape = UsdGeom.PointBased(prim)
    if not shape or prim.IsA(UsdGeom.Mesh) or not query.HasJointInfluences():
        return None
    values, given, attribute = authored_normals(prim)
    count = len(rows_or_empty(vectors(shape.GetPointsAttr())))
    if values is None or not len(values) or (given in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(values) == count):
        return None
    points = _points_of(prim, given)
    if prim.IsA(UsdGeom.TetMesh) and given == UsdGeom.Tokens.uniform and points is not None:
        values, given = np.repeat(values, 3, axis=0), UsdGeom.Tokens.faceVarying
    if points is None or len(points) != len(values) or points.max(initial=0) >= count or points.min(initial=0) < 0:
        return None
    attribute.Block()
    return UnbakedNormals(binding, query, values, points, given)


@dataclass(frozen=True, eq=False)
class RotatedNormals:
    """Rotated normals of one shape at the times of its poses."""

    prim: Usd.Prim
    interpolation: str
    values: list[tuple[Usd.TimeCode, Vt.Vec3fArray]]


def rotated_normals(loose: UnbakedNormals, times: Iterable[Usd.TimeCode]) -> RotatedNormals:
    """Return the rotated normals at all times, to be called before baking removes the skeleton binding; as authored where USD
    has no pose."""
    as_authored = Vt.Vec3fArray.FromNumpy(loose.values)
    values = [(time, found if (found := loose.at(time)) is not None else as_authored) for time in times]
    return RotatedNormals(loose.query.GetPrim(), loose.interpolation, values)


def author_normals(normals: RotatedNormals) -> None:
    """Author the rotated normals at the stage's edit target."""
    shape = UsdGeom.PointBased(normals.prim)
    attribute = shape.CreateNormalsAttr()
    shape.SetNormalsInterpolation(normals.interpolation)
    for time, values in normals.values:
        attribute.Set(values, time)


def _normal_matrix(transform: Gf.Matrix4d) -> Gf.Matrix3d:
    return transform.ExtractRotationMatrix().GetInverse().GetTranspose()


def _in_space(normals: Vt.Vec3fArray, transform: Gf.Matrix4d) -> Vt.Vec3fArray:
    """Return unit normals transformed to another space."""
    found = np.asarray(normals, np.float64) @ np.array(_normal_matrix(transform))
    lengths = np.linalg.norm(found, axis=1, keepdims=True)
    return Vt.Vec3fArray.FromNumpy(np.divide(found, lengths, out=found, where=lengths > 0).astype(np.float32))


def _points_of(prim: Usd.Prim, given: str) -> Numbers | None:
    """Return the index of each normal's point; None if the schema has no such normals."""
    if prim.IsA(UsdGeom.TetMesh):
        per_face = given in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.faceVarying)
        return _faces(UsdGeom.TetMesh(prim)).ravel() if per_face else None
    per_end = given in (UsdGeom.Tokens.varying, UsdGeom.Tokens.faceVarying)  # for curves, both are per segment end
    if prim.IsA(UsdGeom.BasisCurves) and per_end:
        return _ends_of_basis(UsdGeom.BasisCurves(prim))
    if prim.IsA(UsdGeom.NurbsCurves) and per_end:
        return _ends_of_nurbs(UsdGeom.NurbsCurves(prim))
    if prim.IsA(UsdGeom.HermiteCurves) and per_end:
        return np.arange(len(rows_or_empty(vectors(UsdGeom.PointBased(prim).GetPointsAttr()))))
    return None


def _faces(mesh: UsdGeom.TetMesh) -> Numbers:
    """Return the surface faces (F, 3), as they are drawn."""
    surface = integers(mesh.GetSurfaceFaceVertexIndicesAttr(), 3)
    if len(surface):
        return surface
    tets = integers(mesh.GetTetVertexIndicesAttr(), 4)
    faces = surface_of(tets.astype(np.int32)).astype(np.int64) if len(tets) else np.zeros((0, 3), np.int64)
    return faces[:, ::-1] if default_value(mesh.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded else faces


def _ends_of_basis(shape: UsdGeom.BasisCurves) -> Numbers:
    """Return the vertex at, or nearest to, each segment end."""
    counts = np.maximum(integers(shape.GetCurveVertexCountsAttr()), 0)
    kind, basis, wrap = (str(default_value(a)) for a in (shape.GetTypeAttr(), shape.GetBasisAttr(), shape.GetWrapAttr()))
    curves = basis_curves(counts, int(counts.sum()), np.ones(len(counts), bool), kind, basis, wrap)
    at_ends = kind == "linear" or basis == BEZIER
    first, last = curves.corners[:, 0 if at_ends else 1], curves.corners[:, -1 if at_ends else -2]
    found = np.zeros(curves.sizes.ends or 0, np.int64)
    segments = np.arange(len(first)) + np.repeat(np.arange(len(curves.segments)), curves.segments)
    found[curves.ends[segments + 1]] = last
    found[curves.ends[segments]] = first
    return found


def _ends_of_nurbs(shape: UsdGeom.NurbsCurves) -> Numbers:
    """Return the vertex at each knot, distributed evenly over those of its curve."""
    counts, orders = integers(shape.GetCurveVertexCountsAttr()), integers(shape.GetOrderAttr())
    if len(counts) != len(orders):
        return np.zeros(0, np.int64)
    starts, ends = np.cumsum(counts) - counts, np.maximum(counts - orders + 2, 0)
    runs = [np.rint(np.linspace(0, n - 1, m)).astype(np.int64) + s for s, n, m in zip(starts, counts, ends, strict=True) if m]
    return np.concatenate(runs) if runs else np.zeros(0, np.int64)
