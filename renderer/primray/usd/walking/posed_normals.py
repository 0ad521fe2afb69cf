"""Normals of meshes that are about to be posed, in the one form that USD's baking turns with the joints.

That is `normals`, given per point or per corner. It leaves as they were authored: `primvars:normals` (which win where both are
there), and `normals` per face or for a whole mesh.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pxr import Gf, Usd, UsdGeom, Vt

Vectors = npt.NDArray[np.float32]
_ONE = (Gf.Vec3h, Gf.Vec3f, Gf.Vec3d)
_MANY = (Vt.Vec3hArray, Vt.Vec3fArray, Vt.Vec3dArray)


def make_bakeable(prim: Usd.Prim) -> None:
    """Author a mesh's normals anew where they would stay behind, at the stage's edit target; by now none vary over time.

    Those that do not fit the mesh stay as they are: whoever reads it says so.
    """
    mesh = UsdGeom.Mesh(prim)
    if not mesh or mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none:  # limit surfaces have their own
        return
    primvar = UsdGeom.Primvar(prim.GetAttribute("primvars:normals"))
    if primvar and primvar.HasAuthoredValue():
        if _author(mesh, _flattened(primvar), primvar.GetInterpolation()):
            primvar.GetAttr().Block()
        return
    interpolation = mesh.GetNormalsInterpolation()
    values = _vectors(mesh.GetNormalsAttr())
    if values is not None and interpolation in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.constant):
        _author(mesh, values, interpolation)


def _flattened(primvar: UsdGeom.Primvar) -> Vectors | None:
    """Values without indices; None where these lead nowhere: USD would say so in words of its own."""
    values = _vectors(primvar.GetAttr())
    if values is None or not primvar.IsIndexed():
        return values
    indices = np.asarray(primvar.GetIndices(), np.int64)
    return values[indices] if ((indices >= 0) & (indices < len(values))).all() else None


def _vectors(attribute: Usd.Attribute) -> Vectors | None:
    """(N, 3), None for a value of another kind."""
    values = attribute.Get()
    if isinstance(values, _ONE):
        values = [values]
    elif not isinstance(values, _MANY):
        return None
    return np.asarray(values, np.float32).reshape(-1, 3)


def _author(mesh: UsdGeom.Mesh, values: Vectors | None, interpolation: str) -> bool:
    made = None if values is None else _spread(mesh, values, interpolation)
    if made is None:
        return False
    mesh.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(made))
    per_corner = interpolation in (UsdGeom.Tokens.uniform, UsdGeom.Tokens.faceVarying)
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if per_corner else UsdGeom.Tokens.vertex)
    return True


def _spread(mesh: UsdGeom.Mesh, values: Vectors, interpolation: str) -> Vectors | None:
    """(N, 3), one per point or, of normals per face or corner, per corner; None where their number is not the mesh's."""
    attributes = (mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
    points, counts, corners = (len(attribute.Get() or ()) for attribute in attributes)
    expected = {UsdGeom.Tokens.constant: 1, UsdGeom.Tokens.uniform: counts, UsdGeom.Tokens.faceVarying: corners}
    if len(values) != expected.get(interpolation, points):
        return None
    if interpolation == UsdGeom.Tokens.constant:
        return np.repeat(values, points, axis=0)
    if interpolation == UsdGeom.Tokens.uniform:
        sizes = np.asarray(mesh.GetFaceVertexCountsAttr().Get())
        return np.repeat(values, sizes, axis=0) if (sizes >= 0).all() and sizes.sum() == corners else None
    return values
