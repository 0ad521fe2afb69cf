"""Materials of mesh faces: each face has the appearance of the subset that contains it, or that of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Ints
from ..materials.appearance import Appearance, appearance_of
from ..scene.bindings import TETRAHEDRON, Subset
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import array, read, token
from .authored import SurfaceElements


@dataclass(frozen=True)
class FaceParts:
    """Appearances of a mesh. `of_face` (F,) gives the index of each authored face's appearance; index 0 is the mesh's own."""

    appearances: list[Appearance]
    of_face: Ints


def face_parts(prim: ResolvedPrim, faces: int, ctx: Context, tets: SurfaceElements | None = None) -> FaceParts:
    parts = [appearance_of(prim, prim.material, ctx)]
    of_face = np.zeros(faces, np.int32)
    families: list[str | None] = [None]  # of each appearance; None for the mesh's own
    for subset in prim.subsets:
        indices = _faces_of(subset, faces, tets, ctx)
        if indices is None:
            continue
        held = np.array([family == subset.family for family in families])[of_face[indices]]
        if held.any():
            ctx.warn(
                "subset-overlap",
                subset.path,
                f"{int(held.sum())} of its faces are also in another subset of its family: this one is used.",
                "indices",
            )
        families.append(subset.family)
        of_face[indices] = len(parts)
        parts.append(appearance_of(prim, subset.material, ctx))
    if prim.subsets:
        _note_incomplete(prim, of_face, ctx)
    return FaceParts(parts, of_face)


def _faces_of(subset: Subset, faces: int, tets: SurfaceElements | None, ctx: Context) -> Ints | None:
    """Return the faces in a subset, or None and report it if its indices are out of range. Subsets of tetrahedra give those
    surface faces that belong to them."""
    indices = array(read(subset.prim, "indices", ctx.when), 1, "i")
    by_tet = subset.element == TETRAHEDRON
    what, count = ("tetrahedra", 0 if tets is None else len(tets.points)) if by_tet else ("faces", faces)
    if indices is None or (len(indices) and (indices.min() < 0 or indices.max() >= count)):
        ctx.warn(
            "subset-ignored",
            subset.path,
            f"Its indices are not {what} of the mesh, which has {count}: the subset is ignored.",
            "indices",
        )
        return None
    if not by_tet or tets is None:
        return indices
    return np.flatnonzero(np.isin(tets.owners(), indices)).astype(np.int32)


def _note_incomplete(prim: ResolvedPrim, of_face: Ints, ctx: Context) -> None:
    name = "subsetFamily:materialBind:familyType"
    if name in prim.names and token(prim.prim, name, ctx.when, "") == "partition" and not of_face.all():
        rest = int(np.count_nonzero(of_face == 0))
        ctx.warn(
            "subset-incomplete", prim.path, f"{rest} faces are in none of its subsets, although {name} is partition.", name
        )
