"""Subdivision surfaces: UsdGeomMesh with a subdivision scheme as a cage (faces validated and oriented outwards, creases,
corners, primvars of any interpolation), and the adapter that makes a SubdivisionMesh or DisplacedMesh of it.

`Cage` keeps the authored index of each of its faces and corners, since primvars and subsets refer to those. Authored normals
are ignored: the limit surface has its own. Bounds on displacement are those before textures are read: texels count as values in
[0, 1].
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ...arrays import Floats, Ints
from ...description import DisplacedMesh, Interpolation, PointMotion, PrimvarInput, SubdivisionMesh, Surface, TextureInput
from ...description import Primvar as SeamPrimvar
from ..materials.appearance import FALLBACK_COLOR, Appearance, is_cut_out, make_surface
from ..primvars.reading import Primvar, Sizes, read_display_color
from ..primvars.surface_primvars import read_primvars
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from .authored import (
    AuthoredMesh,
    AuthoredSubdivision,
    Faces,
    Flags,
    Topology,
    hole_indices,
    report_inside_out,
    triangle_fans,
    usable_faces,
)
from .subsets import FaceParts, face_parts

SCHEMES = ("catmullClark", "loop", "bilinear")
BOUNDARIES = ("edgeAndCorner", "none", "edgeOnly")
FACE_VARYING_RULES = ("cornersPlus1", "none", "cornersOnly", "cornersPlus2", "boundaries", "all")
TRIANGLE_RULES = ("catmullClark", "smooth")
INTERPOLATIONS = {
    "constant": Interpolation.CONSTANT,
    "uniform": Interpolation.FACE,
    "vertex": Interpolation.POINT,
    "varying": Interpolation.VARYING,
    "faceVarying": Interpolation.CORNER,
}


@dataclass(frozen=True)
class Creases:
    lengths: Ints
    points: Ints
    sharpnesses: Floats  # one per crease, or one per edge


@dataclass(frozen=True)
class Cage:
    points: Floats
    face_counts: Ints
    face_points: Ints
    faces: Ints  # authored index of each face
    corners: Ints  # authored index of each corner
    sizes: Sizes  # as authored
    holes: Ints | None
    creases: Creases | None
    corner_points: Ints | None
    corner_sharpnesses: Floats | None
    scheme: str
    boundary: str
    face_varying: str
    triangle_rule: str
    motion: PointMotion | None = None


def make_cage(mesh: AuthoredMesh, authored: AuthoredSubdivision, topology: Topology, ctx: Context) -> Cage | None:
    """Return the cage, or None if no face is usable."""
    path, sizes = mesh.path, topology.sizes
    points, usable = usable_faces(topology, path, ctx)
    kept = _usable(topology.faces, usable, mesh.is_left_handed)
    if kept.lost:
        ctx.warn(
            "faces-degenerate", path, f"{kept.lost} of {sizes.faces} faces have a vertex more than once: they are left out."
        )
    if len(kept.faces) == 0:
        return None
    creases = _creases(authored, len(points), path, ctx)
    tips, sharpnesses = _sharp_points(authored, len(points), path, ctx)
    return Cage(
        points=points,
        face_counts=kept.counts,
        face_points=kept.points,
        faces=kept.faces,
        corners=kept.corners,
        sizes=sizes,
        holes=_holes(mesh, sizes.faces, kept.faces, ctx),
        creases=creases,
        corner_points=tips,
        corner_sharpnesses=sharpnesses,
        scheme=_scheme(mesh.scheme, kept.counts, path, ctx),
        boundary=_known_token(authored.boundary, "interpolateBoundary", BOUNDARIES, path, ctx),
        face_varying=_known_token(authored.face_varying, "faceVaryingLinearInterpolation", FACE_VARYING_RULES, path, ctx),
        triangle_rule=_known_token(authored.triangle_rule, "triangleSubdivisionRule", TRIANGLE_RULES, path, ctx),
    )


@dataclass(frozen=True, eq=False)
class _UsableFaces:
    """Usable faces, oriented outwards."""

    faces: Ints
    corners: Ints
    counts: Ints
    points: Ints
    lost: int  # usable faces left out because they have a vertex more than once


def _usable(whole: Faces, usable: Flags | None, left_handed: bool) -> _UsableFaces:
    """Return the usable faces; computed once for all cages with the same faces if all of them are usable."""
    known: _UsableFaces | None = whole.made.get(left_handed) if usable is None else None
    if known is not None:
        return known
    faces, corners, lost = _distinct_corners(whole.counts, whole.indices, usable)
    counts = np.bincount(np.searchsorted(faces, _face_of(whole.counts)[corners]), minlength=len(faces)).astype(np.int32)
    if left_handed:
        corners = _reversed_faces(counts, corners)
    made = _UsableFaces(faces, corners, counts, whole.indices[corners].astype(np.int32), lost)
    if usable is None and whole.is_shared:
        whole.made[left_handed] = made
    return made


def _face_of(counts: Ints) -> Ints:
    return np.repeat(np.arange(len(counts), dtype=np.int32), counts)


def _distinct_corners(counts: Ints, indices: Ints, usable: Flags | None) -> tuple[Ints, Ints, int]:
    """Return usable faces and corners. A vertex repeated directly counts once; one that recurs later makes its face
    unusable."""
    face = _face_of(counts)
    start = np.cumsum(counts) - counts
    following = np.arange(1, len(indices) + 1)
    following[(start + counts - 1)[counts > 0]] = start[counts > 0]
    keep = indices != indices[following] if len(indices) else np.zeros(0, bool)
    good = np.bincount(face[keep], minlength=len(counts)) >= 3
    if usable is not None:
        good &= usable
    corners = np.flatnonzero(keep & good[face])
    order = np.lexsort((indices[corners], face[corners]))
    a, b = corners[order[:-1]], corners[order[1:]]
    good[face[a[(indices[a] == indices[b]) & (face[a] == face[b])]]] = False
    lost = int((~good if usable is None else usable & ~good).sum())
    corners = corners[good[face[corners]]]
    return np.flatnonzero(good).astype(np.int32), corners.astype(np.int32), lost


def _reversed_faces(counts: Ints, corners: Ints) -> Ints:
    """Return each face with its corners reversed, starting at the same corner."""
    start = np.repeat(np.cumsum(counts) - counts, counts)
    place = np.arange(len(corners)) - start
    return np.asarray(corners[start + (np.repeat(counts, counts) - place) % np.repeat(counts, counts)])


def _holes(mesh: AuthoredMesh, authored: int, faces: Ints, ctx: Context) -> Ints | None:
    holes = hole_indices(mesh, authored, ctx)
    if holes is None:
        return None
    return np.flatnonzero(np.isin(faces, holes)).astype(np.int32)


def _scheme(authored: str, counts: Ints, path: str, ctx: Context) -> str:
    scheme = _known_token(authored, "subdivisionScheme", SCHEMES, path, ctx)
    if scheme == "loop" and (counts != 3).any():
        sentence = f"subdivisionScheme = loop, but {int((counts != 3).sum())} faces are not triangles: catmullClark is used."
        ctx.warn("subdivision-data", path, sentence, "subdivisionScheme")
        return "catmullClark"
    return scheme


def _known_token(authored: str, name: str, known: Sequence[str], path: str, ctx: Context) -> str:
    """Return the token if it is known, else the first known one; unknown tokens are reported."""
    if authored and authored not in known:
        ctx.warn("subdivision-data", path, f"{name} = {authored} is not known: {known[0]} is used.", name)
    return authored if authored in known else known[0]


def _sharpnesses(values: Floats | None, name: str, path: str, ctx: Context) -> Floats | None:
    """Return sharpnesses clamped to [0, 10]; NaN counts as smooth."""
    if values is None:
        return None
    if np.isnan(values).any():
        ctx.warn("subdivision-data", path, f"{name} has values that are not numbers: they count as 0.", name)
    return np.asarray(np.nan_to_num(np.clip(values, 0, 10), nan=0.0), np.float32)


def _creases(authored: AuthoredSubdivision, points: int, path: str, ctx: Context) -> Creases | None:
    lengths, indices = authored.crease_lengths, authored.crease_points
    sharpnesses = _sharpnesses(authored.crease_sharpnesses, "creaseSharpnesses", path, ctx)
    if all(part is None or len(part) == 0 for part in (lengths, indices, sharpnesses)):
        return None
    problem = ""
    if lengths is None or indices is None or sharpnesses is None:
        problem = "one of creaseLengths, creaseIndices and creaseSharpnesses is missing or of the wrong type"
    elif (len(lengths) and lengths.min() < 2) or int(lengths.sum(dtype=np.int64)) != len(indices):
        problem = f"creaseLengths sum to {int(lengths.sum(dtype=np.int64))} (each at least 2) for {len(indices)} creaseIndices"
    elif len(sharpnesses) not in (len(lengths), len(indices) - len(lengths)):
        problem = f"{len(sharpnesses)} creaseSharpnesses for {len(lengths)} creases of {len(indices) - len(lengths)} edges"
    elif len(indices) and (indices.min() < 0 or indices.max() >= points):
        problem = "creaseIndices has indices outside the points"
    if problem or lengths is None or indices is None or sharpnesses is None:
        ctx.warn("subdivision-data", path, f"Creases are ignored: {problem}.", "creaseIndices")
        return None
    return Creases(lengths, indices, sharpnesses)


def _sharp_points(
    authored: AuthoredSubdivision, points: int, path: str, ctx: Context
) -> tuple[Ints, Floats] | tuple[None, None]:
    indices = authored.corner_points
    sharpnesses = _sharpnesses(authored.corner_sharpnesses, "cornerSharpnesses", path, ctx)
    if all(part is None or len(part) == 0 for part in (indices, sharpnesses)):
        return None, None
    if indices is None or sharpnesses is None or len(indices) != len(sharpnesses):
        counts = [0 if part is None else len(part) for part in (indices, sharpnesses)]
        sentence = f"Corners are ignored: {counts[1]} cornerSharpnesses for {counts[0]} cornerIndices."
        ctx.warn("subdivision-data", path, sentence, "cornerSharpnesses")
        return None, None
    if indices.min() < 0 or indices.max() >= points:
        sentence = "Corners are ignored: cornerIndices has indices outside the points."
        ctx.warn("subdivision-data", path, sentence, "cornerIndices")
        return None, None
    return indices, sharpnesses


def primvar_on_cage(name: str, primvar: Primvar, cage: Cage) -> SeamPrimvar:
    """Return an authored primvar on the faces and corners of the cage."""
    interpolation = INTERPOLATIONS.get(primvar.interpolation, Interpolation.CORNER)
    if interpolation is Interpolation.CORNER:
        # Corner indices are kept: equal indices mean one point of the surface.
        indices = np.arange(len(primvar.values), dtype=np.int32) if primvar.indices is None else primvar.indices
        return SeamPrimvar(name, interpolation, primvar.values, indices[cage.corners])
    values = primvar.flat()
    return SeamPrimvar(name, interpolation, values[cage.faces] if interpolation is Interpolation.FACE else values)


def is_closed_cage(cage: Cage) -> bool:
    """Return whether every edge joins exactly two faces that traverse it in opposite directions, and there are no holes."""
    if cage.holes is not None and len(cage.holes):
        return False
    start = np.cumsum(cage.face_counts) - cage.face_counts
    following = np.arange(1, len(cage.face_points) + 1)
    following[start + cage.face_counts - 1] = start
    a = cage.face_points.astype(np.int64)
    b = a[following]
    size = len(cage.points)
    forward, backward = np.sort(a * size + b), np.sort(b * size + a)
    return bool((forward[1:] != forward[:-1]).all() and np.array_equal(forward, backward))


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
        colors = _display_colors(prim, found, varying, ctx) if varying.any() else None
    if colors is None:
        parts = [replace(part, color=FALLBACK_COLOR) if part.varying_color else part for part in parts]
    surfaces = _surfaces_by_part(parts, part_of_face, found, prim.path, ctx)
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
        _surface_indices(surfaces, part_of_face, ctx),
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
    return replace(made, reach=max(largest_displacement(surface, made.primvars) for surface in surfaces.values()))


def cage_primvars(prim: ResolvedPrim, surfaces: Iterable[Surface], cage: Cage, ctx: Context) -> tuple[SeamPrimvar, ...]:
    """Return primvars per face, point or corner, as SubdivisionMesh has them."""
    return tuple(primvar_on_cage(name, found, cage) for name, found in read_primvars(prim, surfaces, cage.sizes, ctx))


def _surfaces_by_part(parts: list[Appearance], part_of_face: Ints, found: Cage, path: str, ctx: Context) -> dict[int, Surface]:
    """Return the surface of each appearance that at least one face uses, keyed by its index in `parts`; hidden ones are left
    out."""
    worn = [0] if len(parts) == 1 else np.unique(part_of_face).tolist()
    used = [part for part in worn if not is_cut_out(parts[part])]
    is_body = cache(lambda: _checked_closed(found, path, ctx))
    return {part: make_surface(parts[part], is_body, path, ctx) for part in used}


def _checked_closed(found: Cage, path: str, ctx: Context) -> bool:
    """Return whether the cage is closed, so that light can enter it. Reports cages whose faces point inwards."""
    if not is_closed_cage(found):
        return False
    report_inside_out(found.points, triangle_fans(found.face_counts, found.face_points), path, ctx)
    return True


def _surface_indices(surfaces: dict[int, Surface], part_of_face: Ints, ctx: Context) -> int | Ints:
    """Return the index of the surface, or one index per face (F,) with -1 for faces that are not drawn."""
    numbers = {part: ctx.surfaces.index_of(surface) for part, surface in surfaces.items()}
    last = int(part_of_face.max())
    if last == 0:
        return numbers[0]
    return np.array([numbers.get(part, -1) for part in range(last + 1)], np.int32)[part_of_face]


def _display_colors(
    prim: ResolvedPrim, found: Cage, varying: np.ndarray[tuple[int], np.dtype[np.bool_]], ctx: Context
) -> SeamPrimvar | None:
    """Return displayColor for the faces whose surface reads it (`varying`, (F,)), and white for faces whose material has its
    own colour."""
    read = read_display_color(found.sizes, prim, ctx)
    if read is None or read.values.shape[1] != 3:
        return None
    colors = primvar_on_cage("displayColor", read, found)
    if varying.all() or colors.interpolation is Interpolation.CONSTANT:
        return colors
    if colors.interpolation is Interpolation.FACE:
        return replace(colors, values=np.where(varying[:, None], colors.values, np.float32(1)))
    indices = found.face_points if colors.indices is None else colors.indices
    white = np.ones((1, 3), np.float32)
    indices = np.where(np.repeat(varying, found.face_counts), indices, len(colors.values)).astype(np.int32)
    return SeamPrimvar(colors.name, Interpolation.CORNER, np.concatenate([colors.values, white]), indices)


def largest_displacement(surface: Surface, primvars: Collection[SeamPrimvar]) -> float:
    """Return the largest displacement distance of a surface, in the shape's own units; 0 if it is unknown, as for a node
    graph."""
    if surface.displacement is None:
        return 0.0
    value = surface.displacement[1]
    if isinstance(value, TextureInput):
        at = ["rgba".index(channel) for channel in value.channels]
        bias, scale = np.array(value.bias)[at], np.array(value.scale)[at]
        return float(np.linalg.norm(np.maximum(np.abs(bias), np.abs(scale + bias))))
    if not isinstance(value, PrimvarInput):
        return 0.0
    found = next((p.values for p in primvars if p.name == value.name), np.array([value.fallback], np.float32))
    return float(np.linalg.norm(found[:, : len(value.fallback)], axis=1).max(initial=0.0))
