"""Rotation of normals that USD's baking cannot handle, with the joints of their points (UsdSkel.SkinNormals).

Baking rotates one normal per point, and for meshes one per corner. Curves may have one per segment end, which are fewer than
the points, and a TetMesh several at a point.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from pxr import Gf, Usd, UsdGeom, Vt

from ..curves.basis import BEZIER, basis_curves
from ..shapes.tetrahedra import surface_of
from ..stage.reads import default_value, world_transform
from .posed_normals import Vectors, authored_normals, integers, rows, vectors
from .skeleton_bindings import SkeletonBinding

if TYPE_CHECKING:
    from pxr import UsdSkel

Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LooseNormals:
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
        by_name = dict(zip(self.binding.joints, map(_turning, poses), strict=False))
        joints = [by_name.get(name, Gf.Matrix3d(1)) for name in names]
        if not len(joints) or indices.min(initial=0) < 0 or indices.max(initial=0) >= len(joints):
            return None
        normals = Vt.Vec3fArray.FromNumpy(self.values)
        method, bound = self.query.GetSkinningMethod(), _turning(self.query.GetGeomBindTransform(time))
        UsdSkel.SkinNormals(
            method,
            bound,
            Vt.Matrix3dArray(joints),
            Vt.IntArray.FromNumpy(indices),
            Vt.FloatArray.FromNumpy(weights),
            width,
            normals,
        )
        return _turned(normals, self._from_skeleton(time))

    def _from_skeleton(self, time: Usd.TimeCode) -> Gf.Matrix4d:
        cache = UsdGeom.XformCache(time)
        skeleton, shape = (world_transform(cache, prim) for prim in (self.binding.skeleton, self.query.GetPrim()))
        return Gf.Matrix4d(1) if skeleton is None or shape is None else skeleton * shape.GetInverse()

    def _count(self) -> int:
        points = vectors(UsdGeom.PointBased(self.query.GetPrim()).GetPointsAttr())
        return 0 if points is None else len(points)


def take_loose(binding: SkeletonBinding, query: UsdSkel.SkinningQuery) -> LooseNormals | None:
    """Return the normals that baking would ignore or reject, and block their attribute at the stage's edit target; None if
    there are none."""
    prim = query.GetPrim()
    shape = UsdGeom.PointBased(prim)
    if not shape or prim.IsA(UsdGeom.Mesh) or not query.HasJointInfluences():
        return None
    values, given, attribute = authored_normals(prim)
    count = len(rows(vectors(shape.GetPointsAttr())))
    if values is None or not len(values) or (given in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(values) == count):
        return None
    points = _points_of(prim, given)
    if prim.IsA(UsdGeom.TetMesh) and given == UsdGeom.Tokens.uniform and points is not None:
        values, given = np.repeat(values, 3, axis=0), UsdGeom.Tokens.faceVarying
    if points is None or len(points) != len(values) or points.max(initial=0) >= count or points.min(initial=0) < 0:
        return None
    attribute.Block()
    return LooseNormals(binding, query, values, points, given)


@dataclass(frozen=True, eq=False)
class TurnedNormals:
    """Rotated normals of one shape at the times of its poses."""

    prim: Usd.Prim
    interpolation: str
    values: list[tuple[Usd.TimeCode, Vt.Vec3fArray]]


def turned_normals(loose: LooseNormals, times: Iterable[Usd.TimeCode]) -> TurnedNormals:
    """Return the rotated normals at all times, to be called before baking removes the skeleton binding; as authored where USD
    has no pose."""
    as_authored = Vt.Vec3fArray.FromNumpy(loose.values)
    values = [(time, found if (found := loose.at(time)) is not None else as_authored) for time in times]
    return TurnedNormals(loose.query.GetPrim(), loose.interpolation, values)


def author_turned(normals: TurnedNormals) -> None:
    """Author the rotated normals at the stage's edit target."""
    shape = UsdGeom.PointBased(normals.prim)
    attribute = shape.CreateNormalsAttr()
    shape.SetNormalsInterpolation(normals.interpolation)
    for time, values in normals.values:
        attribute.Set(values, time)


def _turning(transform: Gf.Matrix4d) -> Gf.Matrix3d:
    return transform.ExtractRotationMatrix().GetInverse().GetTranspose()


def _turned(normals: Vt.Vec3fArray, transform: Gf.Matrix4d) -> Vt.Vec3fArray:
    """Return unit normals transformed to another space."""
    found = np.asarray(normals, np.float64) @ np.array(_turning(transform))
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
        return np.arange(len(rows(vectors(UsdGeom.PointBased(prim).GetPointsAttr()))))
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
