"""UsdGeomTetMesh: its surface, which is then treated as any polygonal mesh (adapter.py).

The surface is surfaceFaceVertexIndices if authored. Otherwise it is those faces that belong to a single tetrahedron, in the
order of UsdGeomTetMesh::ComputeSurfaceFaces, so that subsets made with that function name the same faces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Ints
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import array, read, token
from .authored import AuthoredMesh, read_normals

TETS, SURFACE = "tetVertexIndices", "surfaceFaceVertexIndices"


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """Tetrahedra together with the surface faces taken from them."""

    points: Ints  # (M, 4)
    surface: Ints  # (F, 3)

    def owners(self) -> Ints:
        """Return the tetrahedron (F,) that each surface face belongs to, the first of several, or -1."""
        faces = sorted_rows(self.points[:, FACES].reshape(-1, 3))
        both = np.concatenate([faces, sorted_rows(self.surface)])
        _, alike = np.unique(both, axis=0, return_inverse=True)
        alike = alike.reshape(-1)
        first = np.full(int(alike.max(initial=-1)) + 1, -1, np.int64)
        first[alike[: len(faces)][::-1]] = np.arange(len(faces))[::-1] // len(FACES)
        return first[alike[len(faces) :]].astype(np.int32)


def read_tet_mesh(prim: ResolvedPrim, ctx: Context) -> AuthoredMesh | None:
    """Return the surface as an authored mesh; None, and reported, if there is none."""
    tets = _indices(prim, TETS, 4, ctx)
    surface = _indices(prim, SURFACE, 3, ctx)
    from_tets = surface is None or len(surface) == 0
    if from_tets:
        if tets is None or len(tets) == 0:
            ctx.warn("invalid-mesh", prim.path, f"It has no {SURFACE}, and no {TETS} to derive them from.", SURFACE)
            return None
        surface = surface_of(tets)
        if len(surface) == 0:
            ctx.warn(
                "invalid-mesh",
                prim.path,
                f"Each face of its {len(tets)} tetrahedra belongs to several of them: it has no surface.",
                TETS,
            )
            return None
    assert surface is not None
    raw = read(prim.prim, "points", ctx.when)
    points = array(raw, 3, "f")
    if points is None:
        ctx.warn("invalid-mesh", prim.path, "points: missing, or of the wrong type.", "points")
        return None
    is_left_handed = "orientation" in prim.names and token(prim.prim, "orientation", ctx.when, "") == "leftHanded"
    faces = surface[:, ::-1] if from_tets and is_left_handed else surface
    return AuthoredMesh(
        path=prim.path,
        points=points.astype(np.float32, copy=False),
        has_points=True,
        counts=np.full(len(faces), 3, np.int32),
        indices=np.ascontiguousarray(faces, np.int32).ravel(),
        holes=None,
        is_left_handed=is_left_handed,
        scheme="none",
        normals=read_normals(prim, ctx.when),
        subdivision=None,
        face_indices=TETS if from_tets else SURFACE,
        tets=None if tets is None else Tetrahedra(tets, surface),
    )


def _indices(prim: ResolvedPrim, name: str, width: int, ctx: Context) -> Ints | None:
    raw = read(prim.prim, name, ctx.when)
    values = None if raw is None else array(raw, width, "i")
    if raw is not None and values is None:
        ctx.warn("wrong-type", prim.path, f"{name} is not an array of type int{width}[]: ignored.", name)
    return values


# Faces of a tetrahedron (UsdGeomTetMesh, tetVertexIndices), counter-clockwise seen from outside. For left-handed ones they run
# the other way, which is the outside by the opposite convention, so the surface is the same.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


def surface_of(tets: Ints) -> Ints:
    """Return the faces (F, 3) that belong to a single tetrahedron, oriented outwards, in lexicographic order."""
    faces = tets[:, FACES].reshape(-1, 3)
    key = sorted_rows(faces)
    order = np.lexsort(key.T[::-1])
    again = (key[order[1:]] == key[order[:-1]]).all(axis=1)
    alone = np.ones(len(faces), bool)
    alone[order[1:][again]] = False
    alone[order[:-1][again]] = False
    found = faces[alone]
    return np.asarray(found[np.lexsort(found.T[::-1])], np.int32)


def sorted_rows(rows: Ints) -> npt.NDArray[np.int64]:
    return np.sort(rows, axis=1).astype(np.int64)
