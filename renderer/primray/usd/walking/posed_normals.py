"""Normals of shapes that are about to be posed, in the one form that USD's baking turns with the joints.

That is `normals`, given per point or, of meshes, per corner. Baking leaves as they were authored: `primvars:normals` (which win
where both are there), and `normals` per face or for a whole shape. What has no such form is turned_normals.py's.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pxr import Gf, Usd, UsdGeom, Vt

from ..querying.guarded import default_value, interpolation, normals_interpolation
from ..resolving.read import array

Vectors = npt.NDArray[np.float32]
_ONE = (Gf.Vec3h, Gf.Vec3f, Gf.Vec3d)
_MANY = (Vt.Vec3hArray, Vt.Vec3fArray, Vt.Vec3dArray)


def make_bakeable(prim: Usd.Prim) -> None:
    """Author a shape's normals in that form where they would stay behind, at the stage's edit target; none vary over time now.

    Those that do not fit the shape stay as they are: whoever reads it reports them.
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
    """Whether a mesh's normals are those of its limit surface."""
    mesh = UsdGeom.Mesh(prim)
    return bool(mesh) and default_value(mesh.GetSubdivisionSchemeAttr()) != UsdGeom.Tokens.none


def authored_normals(prim: Usd.Prim) -> tuple[Vectors | None, str, Usd.Attribute]:
    """Return the normals that count, without indices, their interpolation, and the attribute that has them."""
    primvar = UsdGeom.Primvar(prim.GetAttribute("primvars:normals"))
    if primvar and primvar.HasAuthoredValue():
        return _flattened(primvar), interpolation(primvar), primvar.GetAttr()
    shape = UsdGeom.PointBased(prim)
    return vectors(shape.GetNormalsAttr()), normals_interpolation(shape), shape.GetNormalsAttr()


def _flattened(primvar: UsdGeom.Primvar) -> Vectors | None:
    """Values without indices; None where these lead nowhere: USD would say so in words of its own."""
    values = vectors(primvar.GetAttr())
    if values is None or not primvar.IsIndexed():
        return values
    indices = integers(primvar.GetIndicesAttr())
    return values[indices] if ((indices >= 0) & (indices < len(values))).all() else None


def vectors(attribute: Usd.Attribute) -> Vectors | None:
    """(N, 3), None for a value of another kind."""
    values = default_value(attribute)
    if isinstance(values, _ONE):
        values = [values]
    elif not isinstance(values, _MANY):
        return None
    return np.asarray(values, np.float32).reshape(-1, 3)


def integers(attribute: Usd.Attribute, columns: int = 1) -> npt.NDArray[np.int64]:
    """(N,) or (N, columns), none for a value of another kind."""
    values = array(default_value(attribute), columns, "i")
    none = np.zeros(0 if columns == 1 else (0, columns), np.int64)
    return none if values is None else values.astype(np.int64)


def rows(values: Vectors | None) -> Vectors:
    return np.zeros((0, 3), np.float32) if values is None else values


def _author(shape: UsdGeom.PointBased, values: Vectors | None, given: str) -> bool:
    mesh = UsdGeom.Mesh(shape)
    made = None if values is None else _spread(mesh, values, given) if mesh else _per_point(shape, values, given)
    if made is None:
        return False
    shape.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(made))
    per_corner = mesh and given in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.faceVarying)
    per_end = not mesh and given == UsdGeom.Tokens.varying  # of curves: linear from end to end, whatever the basis
    kind = UsdGeom.Tokens.varying if per_end else UsdGeom.Tokens.vertex
    shape.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if per_corner else kind)
    return True


def _per_point(shape: UsdGeom.PointBased, values: Vectors, given: str) -> Vectors | None:
    """(N, 3) of a shape that is no mesh; None where its normals cannot be given per point, or do not fit."""
    count = len(rows(vectors(shape.GetPointsAttr())))
    if given == UsdGeom.Tokens.constant:
        return np.repeat(values, count, axis=0) if len(values) == 1 else None
    if given == UsdGeom.Tokens.uniform:
        curves = UsdGeom.Curves(shape)
        sizes = integers(curves.GetCurveVertexCountsAttr()) if curves else np.zeros(0, np.int64)
        fits = len(values) == len(sizes) and (sizes >= 0).all() and sizes.sum() == count
        return np.repeat(values, sizes, axis=0) if fits else None
    return values if given in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(values) == count else None


def _spread(mesh: UsdGeom.Mesh, values: Vectors, given: str) -> Vectors | None:
    """(N, 3), one per point or, of normals per face or corner, per corner; None where their number is not the mesh's."""
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
