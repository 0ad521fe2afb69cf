"""Conversion of normals, before skinning, to the form that USD's baking rotates with the joints.

That form is `normals`, per point or, for meshes, per corner. Baking does not rotate `primvars:normals` (which take precedence)
nor uniform or constant `normals`. Normals that cannot be converted are handled by turned_normals.py.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pxr import Gf, Usd, UsdGeom, Vt

from ..stage.reads import default_value, interpolation, normals_interpolation
from ..stage.values import array

Vectors = npt.NDArray[np.float32]
_ONE = (Gf.Vec3h, Gf.Vec3f, Gf.Vec3d)
_MANY = (Vt.Vec3hArray, Vt.Vec3fArray, Vt.Vec3dArray)


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
    if isinstance(values, _ONE):
        values = [values]
    elif not isinstance(values, _MANY):
        return None
    return np.asarray(values, np.float32).reshape(-1, 3)


def integers(attribute: Usd.Attribute, columns: int = 1) -> npt.NDArray[np.int64]:
    """Return an integer attribute as (N,) or (N, columns); empty for other types."""
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
    per_end = not mesh and given == UsdGeom.Tokens.varying  # on curves: linear between segment ends, whatever the basis
    kind = UsdGeom.Tokens.varying if per_end else UsdGeom.Tokens.vertex
    shape.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if per_corner else kind)
    return True


def _per_point(shape: UsdGeom.PointBased, values: Vectors, given: str) -> Vectors | None:
    """Return the normals per point (N, 3) of a shape other than a mesh; None if they do not fit or cannot be given per
    point."""
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
