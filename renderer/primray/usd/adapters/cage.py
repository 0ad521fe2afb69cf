"""UsdGeomMesh with a subdivision scheme to a SubdivisionMesh: its cage (usd/subdivision.py), colours, primvars and surfaces.

Authored normals do not count: the limit surface has its own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...description import Interpolation, Ints, Primvar, PrimvarInput, SubdivisionMesh
from ..context import Context
from ..read import array, read
from ..resolve import ResolvedPrim
from ..subdivision import Cage, cage_primvar, cage_primvars, is_closed_cage, read_cage
from .surface import Appearance, appearance_of, is_hidden, surface_of


def cage(prim: ResolvedPrim, ctx: Context) -> SubdivisionMesh | None:
    found: Cage | None = ctx.shared_geometry.get(prim.path) or read_cage(prim, ctx)
    if found is None:
        return None
    if prim.path in ctx.shares:
        ctx.shared_geometry[prim.path] = found
    parts, part_of_face = _parts(prim, found, ctx)
    varying = np.array([part.varying_color for part in parts])
    colors = _colors(prim, found, varying[part_of_face], ctx) if varying[part_of_face].any() else None
    if colors is None:
        parts = [Appearance(None) if part.varying_color else part for part in parts]
    surface = _surfaces(parts, part_of_face, found, ctx)
    if surface is None:
        return None
    creases = found.creases
    return SubdivisionMesh(
        prim.path,
        found.scheme,
        found.points,
        found.face_counts,
        found.face_points,
        surface,
        colors,
        found.holes,
        None if creases is None else creases.lengths,
        None if creases is None else creases.points,
        None if creases is None else creases.sharpnesses,
        found.corner_points,
        found.corner_sharpnesses,
        found.boundary,
        found.face_varying,
        found.triangle_rule,
        cage_primvars(prim, names_read(surface, ctx), found, ctx),
    )


def names_read(surface: int | Ints, ctx: Context) -> list[str]:
    """The primvars that inputs of these surfaces read."""
    surfaces = list(ctx.surfaces)
    inputs = [found for k in np.unique(surface) if k >= 0 for _, found in surfaces[k].inputs]
    return sorted({found.name if isinstance(found, PrimvarInput) else found.st.name for found in inputs})


def _parts(prim: ResolvedPrim, found: Cage, ctx: Context) -> tuple[list[Appearance], Ints]:
    """The mesh's own appearance and those of its subsets, and of each face of the cage which one it has."""
    parts = [appearance_of(prim, prim.material, ctx)]
    authored = np.zeros(found.sizes.faces, np.int32)
    for subset in prim.subsets:
        indices = array(read(subset.prim, "indices", ctx.when), 1, "i")
        if indices is None or (len(indices) and (indices.min() < 0 or indices.max() >= len(authored))):
            ctx.warn("subset-ignored", subset.path, f"Its indices are not faces of the mesh, which has {len(authored)}.")
            continue
        authored[indices] = len(parts)
        parts.append(appearance_of(prim, subset.material, ctx))
    return parts, authored[found.faces]


def _surfaces(parts: list[Appearance], part_of_face: Ints, found: Cage, ctx: Context) -> int | Ints | None:
    """One surface, or one a face with -1 where nothing is drawn; None where nothing is drawn at all."""
    index = np.full(len(parts), -1, np.int32)
    for part in np.unique(part_of_face):
        if not is_hidden(parts[part]):
            index[part] = surface_of(parts[part], lambda: is_closed_cage(found), ctx)
    if len(parts) == 1:
        return None if index[0] < 0 else int(index[0])
    surfaces = index[part_of_face]
    return surfaces if (surfaces >= 0).any() else None


def _colors(
    prim: ResolvedPrim, found: Cage, varying: np.ndarray[tuple[int], np.dtype[np.bool_]], ctx: Context
) -> Primvar | None:
    """displayColor on the faces whose surface takes it (`varying`, (F,)), 1 on those with a colour of their own."""
    colors = cage_primvar(prim.prim.GetAttribute("primvars:displayColor"), "displayColor", found, prim, ctx)
    if colors is None or colors.values.shape[1] != 3:
        return None
    if varying.all() or colors.interpolation is Interpolation.CONSTANT:
        return colors
    if colors.interpolation is Interpolation.FACE:
        return replace(colors, values=np.where(varying[:, None], colors.values, np.float32(1)))
    indices = found.face_points if colors.indices is None else colors.indices
    white = np.ones((1, 3), np.float32)
    indices = np.where(np.repeat(varying, found.face_counts), indices, len(colors.values)).astype(np.int32)
    return Primvar(colors.name, Interpolation.CORNER, np.concatenate([colors.values, white]), indices)
