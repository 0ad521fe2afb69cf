"""Adapter from a UsdGeomMesh with a subdivision scheme to a SubdivisionMesh: cage (usd/shapes/subdivision.py), colours,
primvars and surfaces.

Authored normals are ignored: the limit surface has its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np

from ....arrays import Ints
from ....description import DisplacedMesh, Interpolation, SubdivisionMesh, Surface
from ....description import Primvar as SeamPrimvar
from ...scene.context import Context
from ...scene.inheritance import ResolvedPrim
from ...shapes.displacement_reach import reach_of
from ...shapes.primvars import read_display_color
from ...shapes.subdivision import Cage, is_closed_cage, on_cage
from ...shapes.surface_primvars import read_primvars
from ..materials.surface import FALLBACK_COLOR, Appearance, is_hidden, make_surface
from .face_parts import FaceParts, face_parts
from .inside_out import fans, note_inside_out


def make_subdivision_mesh(
    prim: ResolvedPrim, found: Cage, ctx: Context, parts_of: FaceParts | None = None
) -> SubdivisionMesh | None:
    """Return the subdivision cage with its surfaces and primvars: a DisplacedMesh where any of its materials has displacement.
    None if no face is drawn."""
    whole = face_parts(prim, found.sizes.faces, ctx) if parts_of is None else parts_of
    parts, part_of_face = whole.appearances, whole.of_face[found.faces]
    colors = None
    if any(part.varying_color for part in parts):
        varying = np.array([part.varying_color for part in parts])[part_of_face]
        colors = _colors(prim, found, varying, ctx) if varying.any() else None
    if colors is None:
        parts = [replace(part, color=FALLBACK_COLOR) if part.varying_color else part for part in parts]
    surfaces = _surfaces(parts, part_of_face, found, prim.path, ctx)
    if not surfaces:
        return None
    creases = found.creases
    moves = any(surface.displacement is not None for surface in surfaces.values())
    made = (DisplacedMesh if moves else SubdivisionMesh)(
        prim.path,
        found.scheme,
        found.points,
        found.face_counts,
        found.face_points,
        _indices(surfaces, part_of_face, ctx),
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
        cage_primvars(prim, surfaces.values(), found, ctx),
        motion=found.motion,
    )
    if not isinstance(made, DisplacedMesh):
        return made
    return replace(made, reach=max(reach_of(surface, made.primvars) for surface in surfaces.values()))


def cage_primvars(prim: ResolvedPrim, surfaces: Iterable[Surface], cage: Cage, ctx: Context) -> tuple[SeamPrimvar, ...]:
    """Return primvars per face, point or corner, as SubdivisionMesh has them."""
    return tuple(on_cage(name, found, cage) for name, found in read_primvars(prim, surfaces, cage.sizes, ctx))


def _surfaces(parts: list[Appearance], part_of_face: Ints, found: Cage, path: str, ctx: Context) -> dict[int, Surface]:
    """Return the surface of each appearance that at least one face uses, keyed by its index in `parts`; hidden ones are left
    out."""
    worn = [0] if len(parts) == 1 else np.unique(part_of_face).tolist()
    used = [part for part in worn if not is_hidden(parts[part])]
    is_body = cache(lambda: _is_body(found, path, ctx))
    return {part: make_surface(parts[part], is_body, path, ctx) for part in used}


def _is_body(found: Cage, path: str, ctx: Context) -> bool:
    """Return whether the cage is closed, so that light can enter it. Reports cages whose faces point inwards."""
    if not is_closed_cage(found):
        return False
    note_inside_out(found.points, fans(found.face_counts, found.face_points), path, ctx)
    return True


def _indices(surfaces: dict[int, Surface], part_of_face: Ints, ctx: Context) -> int | Ints:
    """Return the index of the surface, or one index per face (F,) with -1 for faces that are not drawn."""
    numbers = {part: ctx.surfaces.index_of(surface) for part, surface in surfaces.items()}
    last = int(part_of_face.max())
    if last == 0:
        return numbers[0]
    return np.array([numbers.get(part, -1) for part in range(last + 1)], np.int32)[part_of_face]


def _colors(
    prim: ResolvedPrim, found: Cage, varying: np.ndarray[tuple[int], np.dtype[np.bool_]], ctx: Context
) -> SeamPrimvar | None:
    """Return displayColor for the faces whose surface reads it (`varying`, (F,)), and white for faces whose material has its
    own colour."""
    read = read_display_color(found.sizes, prim, ctx)
    if read is None or read.values.shape[1] != 3:
        return None
    colors = on_cage("displayColor", read, found)
    if varying.all() or colors.interpolation is Interpolation.CONSTANT:
        return colors
    if colors.interpolation is Interpolation.FACE:
        return replace(colors, values=np.where(varying[:, None], colors.values, np.float32(1)))
    indices = found.face_points if colors.indices is None else colors.indices
    white = np.ones((1, 3), np.float32)
    indices = np.where(np.repeat(varying, found.face_counts), indices, len(colors.values)).astype(np.int32)
    return SeamPrimvar(colors.name, Interpolation.CORNER, np.concatenate([colors.values, white]), indices)
