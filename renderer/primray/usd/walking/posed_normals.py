"""Normals of meshes that are about to be posed, in the one form that USD's baking turns with the joints.

That is `normals`, given per point or per corner. It leaves as they were authored: `primvars:normals` (which win where both are
there), and `normals` per face or for a whole mesh.
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
    """Author a mesh's normals anew where they would stay behind, at the stage's edit target; by now none vary over time.

    Those that do not fit the mesh stay as they are: whoever reads it says so.
    """
    mesh = UsdGeom.Mesh(prim)
    if not mesh or default_value(mesh.GetSubdivisionSchemeAttr()) != UsdGeom.Tokens.none:  # limit surfaces have their own
        return
    primvar = UsdGeom.Primvar(prim.GetAttribute("primvars:normals"))
    if primvar and primvar.HasAuthoredValue():
        if _author(mesh, _flattened(primvar), interpolation(primvar)):
            primvar.GetAttr().Block()
        return
    given = normals_interpolation(mesh)
    values = _vectors(mesh.GetNormalsAttr())
    if values is not None and given in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.constant):
        _author(mesh, values, given)


def _flattened(primvar: UsdGeom.Primvar) -> Vectors | None:
    """Values without indices; None where these lead nowhere: USD would say so in words of its own."""
    values = _vectors(primvar.GetAttr())
    if values is None or not primvar.IsIndexed():
        return values
    indices = _integers(primvar.GetIndicesAttr())
    return values[indices] if ((indices >= 0) & (indices < len(values))).all() else None


def _vectors(attribute: Usd.Attribute) -> Vectors | None:
    """(N, 3), None for a value of another kind."""
    values = default_value(attribute)
    if isinstance(values, _ONE):
        values = [values]
    elif not isinstance(values, _MANY):
        return None
    return np.asarray(values, np.float32).reshape(-1, 3)


def _integers(attribute: Usd.Attribute) -> npt.NDArray[np.int64]:
    """(N,), none for a value of another kind."""
    values = array(default_value(attribute), 1, "i")
    return np.zeros(0, np.int64) if values is None else values.astype(np.int64)


def _author(mesh: UsdGeom.Mesh, values: Vectors | None, given: str) -> bool:
    made = None if values is None else _spread(mesh, values, given)
    if made is None:
        return False
    mesh.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(made))
    per_corner = given in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.faceVarying)
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if per_corner else UsdGeom.Tokens.vertex)
    return True


def _spread(mesh: UsdGeom.Mesh, values: Vectors, given: str) -> Vectors | None:
    """(N, 3), one per point or, of normals per face or corner, per corner; None where their number is not the mesh's."""
    points, corners = _vectors(mesh.GetPointsAttr()), len(_integers(mesh.GetFaceVertexIndicesAttr()))
    sizes, count = _integers(mesh.GetFaceVertexCountsAttr()), 0 if points is None else len(points)
    expected = {UsdGeom.Tokens.constant: 1, UsdGeom.Tokens.uniform: len(sizes), UsdGeom.Tokens.faceVarying: corners}
    if len(values) != expected.get(given, count):
        return None
    if given == UsdGeom.Tokens.constant:
        return np.repeat(values, count, axis=0)
    if given == UsdGeom.Tokens.uniform:
        return np.repeat(values, sizes, axis=0) if (sizes >= 0).all() and sizes.sum() == corners else None
    return values
