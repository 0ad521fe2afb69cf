"""Authored data of a Mesh prim: the one place where its geometric attributes are read from USD.

Only types are checked: a value that is missing or has the wrong type is None (or "" for tokens). Validation and its diagnostics
are in topology.py, polygons.py and subdivision.py, which work from this and read nothing from USD.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom

from ...arrays import Floats, Ints
from ..scene.inheritance import ResolvedPrim
from ..stage.reads import normals_interpolation
from ..stage.values import When, array, read, token, value
from .primvars import AuthoredPrimvar, read_authored


@dataclass(frozen=True, eq=False)
class AuthoredSubdivision:
    """Attributes that only subdivision surfaces use; point indices are as authored."""

    boundary: str = ""  # interpolateBoundary
    face_varying: str = ""  # faceVaryingLinearInterpolation
    triangle_rule: str = ""  # triangleSubdivisionRule
    crease_lengths: Ints | None = None  # (K,) int32, the number of points of each crease
    crease_points: Ints | None = None  # int32, concatenated over creases
    crease_sharpnesses: Floats | None = None  # one per crease, or one per edge; 0 smooth, 10 sharp
    corner_points: Ints | None = None  # (S,) int32
    corner_sharpnesses: Floats | None = None  # (S,), 0 smooth, 10 sharp


_NAMES = """interpolateBoundary faceVaryingLinearInterpolation triangleSubdivisionRule
    creaseLengths creaseIndices creaseSharpnesses cornerIndices cornerSharpnesses"""
_SUBDIVISION = frozenset(_NAMES.split())
_PLAIN = AuthoredSubdivision()  # shared by all meshes without such attributes


class Owned(Protocol):
    """Elements whose outer faces form a surface, such as tetrahedra."""

    @property
    def points(self) -> Ints:
        """Vertex indices, one row per element."""

    def owners(self) -> Ints:
        """Return the element (F,) that each surface face belongs to, or -1."""


@dataclass(frozen=True, eq=False)
class AuthoredMesh:
    path: str
    points: Floats | None  # (N, 3) float32, object space, scene units
    has_points: bool  # true even if they have the wrong type
    counts: Ints | None  # (F,) the number of corners of each face
    indices: Ints | None  # (C,) the point at each corner
    holes: Ints | None  # (H,) indices of faces
    is_left_handed: bool
    scheme: str  # subdivisionScheme
    normals: AuthoredPrimvar | None  # polygons only: limit surfaces have their own
    subdivision: AuthoredSubdivision | None  # None for polygons
    face_indices: str = "faceVertexIndices"  # attribute that `indices` come from
    tets: Owned | None = None  # TetMesh only


def read_mesh(prim: ResolvedPrim, when: When) -> AuthoredMesh:
    scheme = _token(prim, "subdivisionScheme", when)
    counts = array(read(prim.prim, "faceVertexCounts", when), 1, "i")
    indices = array(read(prim.prim, "faceVertexIndices", when), 1, "i")
    points = read(prim.prim, "points", when)
    return AuthoredMesh(
        prim.path,
        _points(points),
        points is not None,
        counts,
        indices,
        _array(prim, "holeIndices", when, "i"),
        _token(prim, "orientation", when) == "leftHanded",
        scheme,
        read_normals(prim, when) if scheme == "none" else None,
        None if scheme == "none" else _subdivision(prim, when),
    )


def _points(raw: object) -> Floats | None:
    points = array(raw, 3, "f")
    return None if points is None else points.astype(np.float32, copy=False)


def read_normals(prim: ResolvedPrim, when: When) -> AuthoredPrimvar | None:
    """Return `primvars:normals` if it has a value, else `normals` (UsdGeomMesh, UsdGeomPointBased::GetNormalsAttr)."""
    if "primvars:normals" in prim.names:
        attribute = prim.prim.GetAttribute("primvars:normals")
        if attribute.HasAuthoredValue():
            return read_authored(attribute, when)
    raw = value(prim.prim.GetAttribute("normals"), when) if "normals" in prim.names else None
    if raw is None or (hasattr(raw, "__len__") and len(raw) == 0):
        return None
    return AuthoredPrimvar("normals", raw, normals_interpolation(UsdGeom.PointBased(prim.prim)))


def _subdivision(prim: ResolvedPrim, when: When) -> AuthoredSubdivision:
    if prim.names.isdisjoint(_SUBDIVISION):
        return _PLAIN
    return AuthoredSubdivision(
        _token(prim, "interpolateBoundary", when),
        _token(prim, "faceVaryingLinearInterpolation", when),
        _token(prim, "triangleSubdivisionRule", when),
        _integers(prim, "creaseLengths", when),
        _integers(prim, "creaseIndices", when),
        _array(prim, "creaseSharpnesses", when, "f"),
        _integers(prim, "cornerIndices", when),
        _array(prim, "cornerSharpnesses", when, "f"),
    )


def _token(prim: ResolvedPrim, name: str, when: When) -> str:
    return token(prim.prim, name, when, "") if name in prim.names else ""


def _array(prim: ResolvedPrim, name: str, when: When, kind: str) -> npt.NDArray[Any] | None:
    return array(read(prim.prim, name, when), 1, kind) if name in prim.names else None


def _integers(prim: ResolvedPrim, name: str, when: When) -> Ints | None:
    values = _array(prim, name, when, "i")
    return None if values is None else values.astype(np.int32)
