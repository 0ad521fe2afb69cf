"""Surface of tetrahedra: the faces that belong to a single tetrahedron."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...arrays import Ints

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
