"""Dicing of every SubdivisionMesh to a Mesh on its limit surface, of every NurbsPatch and of all Ribbons, as finely as the
camera's view requires; what was diced for an earlier view is taken again where it would be the same.

The refinement of cages itself is in the core (core/subdivision/dicing/dice.hpp), that of patches in nurbs/.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from operator import is_
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..arrays import Floats, Ints
from ..description import (
    DisplacedMesh,
    Interpolation,
    Mesh,
    NurbsPatch,
    PointMotion,
    Primvar,
    Ribbons,
    SceneDescription,
    SubdivisionMesh,
)
from ..settings import RenderSettings
from .footprint import EVERYWHERE, MAX_LEVEL, OUTSIDE, Footprint, KeptFootprints, footprints
from .nurbs.patches import DicedPatch, Fineness, dice_patches, triangles_of
from .ribbons import quads_of, strip

# Tokens in the order of the core's enumerations (topology.hpp, face_varying.cpp).
SCHEMES = ("catmullClark", "loop", "bilinear")
BOUNDARIES = ("none", "edgeOnly", "edgeAndCorner")
FACE_VARYING_RULES = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")

MAX_TRIANGLES = 1 << 24
FLATNESS = 0.1
BYTES_PER_TRIANGLE = 300  # peak of dicing and building: 170 measured without primvars
# Displaced cages get shorter edges (factor) and deeper subdivision (levels): they have no detail except their vertices, and
# often are one face.
DISPLACED_EDGES, DISPLACED_LEVELS = 0.5, 2
MAX_BATCH = 64  # cages that a thread takes at a time
NO_INTS = np.zeros(0, np.int32)
NO_FLOATS = np.zeros(0, np.float32)
NO_COLUMNS = np.zeros((0, 0), np.float32)

Warnings = list[tuple[str, str, str]]  # code, prim path, message
OnCage = Callable[[int, int], None]


class DicedCage(Protocol):
    """What the core makes of a cage: arrays of triangles, and what limited them."""

    @property
    def points(self) -> Floats: ...
    @property
    def normals(self) -> Floats: ...
    @property
    def vertex_values(self) -> Floats: ...
    @property
    def varying_values(self) -> Floats: ...
    @property
    def step_points(self) -> list[Floats]: ...
    @property
    def step_normals(self) -> list[Floats]: ...
    @property
    def face_varying(self) -> list[tuple[Ints, Floats]]: ...
    @property
    def triangles(self) -> Ints: ...
    @property
    def normal_indices(self) -> Ints: ...
    @property
    def faces(self) -> Ints: ...
    @property
    def level_limited(self) -> bool: ...
    @property
    def non_manifold_edges(self) -> int: ...
    @property
    def unknown_creases(self) -> int: ...


class Dicer(Protocol):
    """The compiled core, which dices cages given by their arrays."""

    def dice(self, cage: dict[str, object]) -> DicedCage | None:
        """Return the diced cage; None if it has too many triangles."""

    def estimated_triangles(self, cage: dict[str, object]) -> int: ...


class Displacements(Protocol):
    """Source of displacements for diced shapes."""

    @property
    def warnings(self) -> Warnings:
        """What is reported of the shapes that `of` was called for."""

    def depends_on(self, number: int, shape: DisplacedMesh) -> tuple[tuple[object, ...], object]:
        """Return all that the data depends on besides the shape, texels aside: objects, and what compares equal."""

    def of(self, number: int, shape: DisplacedMesh) -> dict[str, object]:
        """Return the displacement data of the shape with this index in the description, for the core's dice()."""


@dataclass(frozen=True)
class Dicing:
    """Dicing rate: edges at most `pixels` long, between two levels; equal levels make it uniform. Faces flat to within
    `flatness` pixels are not split, however long they are; 0 splits all."""

    pixels: float
    min_level: int = 0
    max_level: int = MAX_LEVEL
    max_triangles: int = MAX_TRIANGLES
    flatness: float = FLATNESS


def dicing_of_cage(cage: SubdivisionMesh, dicing: Dicing) -> Dicing:
    """Return the dicing rate for a cage, finer if it is displaced."""
    if not isinstance(cage, DisplacedMesh):
        return dicing
    further = DISPLACED_LEVELS if dicing.min_level < dicing.max_level else 0
    return replace(dicing, pixels=dicing.pixels * DISPLACED_EDGES, max_level=dicing.max_level + further, flatness=0.0)


def dicing_by_settings(settings: RenderSettings) -> Dicing:
    """Return the dicing rate by the render settings; triangles may take half of the memory limit, if one is set."""
    limit = MAX_TRIANGLES
    if settings.max_memory_bytes is not None:
        limit = max(1, min(limit, settings.max_memory_bytes // 2 // BYTES_PER_TRIANGLE))
    return Dicing(settings.dicing_rate, max_triangles=limit)


Made = TypeVar("Made")


@dataclass(frozen=True)
class DicedShape(Generic[Made]):
    """A shape's triangles, and all that they depend on: objects, which must be the same, and what compares equal."""

    given: tuple[object, ...]
    key: object
    made: Made
    mesh: Mesh

    def is_of(self, given: tuple[object, ...], key: object) -> bool:
        return len(self.given) == len(given) and all(map(is_, self.given, given)) and self.key == key


class DicedBefore:
    """What was diced for an earlier view, by the index of its shape: taken again where nothing that it depends on has changed.

    Textures of displacements count as unchanged: whoever reads another file forgets all of this.
    """

    def __init__(self) -> None:
        self.cages: dict[int, DicedShape[DicedCage]] = {}
        self.patches: dict[int, DicedShape[DicedPatch]] = {}
        self.ribbons: dict[int, DicedShape[None]] = {}
        self.displaced: list[int] = []  # indices of displaced cages, and what was reported of them
        self.displaced_warnings: Warnings = []
        self.footprints = {kind: KeptFootprints() for kind in (SubdivisionMesh, NurbsPatch, Ribbons)}


@dataclass(frozen=True)
class _Cages:
    """Cages of a description, with their footprints, and what their triangles depend on."""

    shapes: dict[int, SubdivisionMesh]
    prints: dict[int, Footprint]
    depends_on: dict[int, tuple[tuple[object, ...], object]]  # that displaces them
    displaced: Displacements | None

    @staticmethod
    def of(description: SceneDescription, prints: dict[int, Footprint], displaced: Displacements | None) -> _Cages:
        shapes = {k: s for k, s in enumerate(description.shapes) if isinstance(s, SubdivisionMesh)}
        depends_on = {
            k: displaced.depends_on(k, s) for k, s in shapes.items() if displaced is not None and isinstance(s, DisplacedMesh)
        }
        return _Cages(shapes, prints, depends_on, displaced)

    def given(self, k: int) -> tuple[object, ...]:
        return (self.shapes[k], *(self.depends_on[k][0] if k in self.depends_on else ()))

    def key(self, k: int, dicing: Dicing) -> object:
        return key_of(self.prints[k]), dicing, self.depends_on[k][1] if k in self.depends_on else None

    def made_before(self, k: int, known: DicedBefore, dicing: Dicing) -> DicedCage | None:
        one = known.cages.get(k)
        return one.made if one is not None and one.is_of(self.given(k), self.key(k, dicing)) else None

    def displacement(self, k: int) -> dict[str, object] | None:
        shape = self.shapes[k]
        return self.displaced.of(k, shape) if self.displaced is not None and isinstance(shape, DisplacedMesh) else None


def dice(
    core: Dicer,
    description: SceneDescription,
    dicing: Dicing,
    threads: int,
    displaced: Displacements | None = None,
    known: DicedBefore | None = None,
    on_cage: OnCage | None = None,
) -> tuple[SceneDescription, Warnings]:
    """Return the description with cages diced to triangles, and warnings. Edges are longer than asked if there would be too
    many triangles. `known`: what was diced before, which is used where nothing has changed; it is updated. `on_cage` is called
    with the number of cages that have been diced, and of all."""
    known = DicedBefore() if known is None else known
    prints = footprints(description, SubdivisionMesh, known.footprints[SubdivisionMesh])
    if not prints:
        return description, []
    cages = _Cages.of(description, prints, displaced)
    made, pixels = _within_limit(core, cages, dicing, threads, known, on_cage)
    warnings = list(known.displaced_warnings)
    if pixels > dicing.pixels:
        warnings.append(
            (
                "dicing-limited",
                "",
                f"Edges cover {pixels:g} pixels instead of {dicing.pixels:g}, for at most {dicing.max_triangles} triangles.",
            )
        )
    shapes = list(description.shapes)
    before, known.cages = known.cages, {}
    for k, cage in cages.shapes.items():
        mesh = before[k].mesh if k in before and before[k].made is made[k] else _mesh(cage, made[k])
        shapes[k] = mesh
        known.cages[k] = DicedShape(cages.given(k), cages.key(k, replace(dicing, pixels=pixels)), made[k], mesh)
        warnings += _warnings(cage, made[k], dicing_of_cage(cage, replace(dicing, pixels=pixels)))
    return replace(description, shapes=tuple(shapes)), warnings


def _within_limit(
    core: Dicer, cages: _Cages, dicing: Dicing, threads: int, known: DicedBefore, on_cage: OnCage | None = None
) -> tuple[dict[int, DicedCage], float]:
    """Return the core's results and the edge length in pixels, which is doubled until all cages together have few enough
    triangles."""
    pixels, shapes = dicing.pixels, cages.shapes
    moved: dict[int, dict[str, object] | None] = {}
    with ThreadPoolExecutor(max(threads, 1)) as pool:
        while True:
            limit = dicing.max_triangles if pixels < 1e6 else 1 << 31
            now = replace(dicing, pixels=pixels, max_triangles=limit)
            done = {k: found for k in shapes if (found := cages.made_before(k, known, now)) is not None}
            if not moved and (any(k not in done for k in cages.depends_on) or known.displaced != list(cages.depends_on)):
                # All at once, for what is reported of them.
                moved = {k: cages.displacement(k) for k in cages.depends_on}
                known.displaced = list(moved)
                known.displaced_warnings = [] if cages.displaced is None else list(cages.displaced.warnings)
            numbers = [k for k in shapes if k not in done]
            size = max(1, min(MAX_BATCH, len(numbers) // (16 * max(threads, 1))))  # handing over single small cages is slow
            batches = [numbers[start : start + size] for start in range(0, len(numbers), size)]
            jobs = [
                pool.submit(_dice_some, core, [(shapes[k], cages.prints[k], moved.get(k)) for k in some], now)
                for some in batches
            ]
            made = dict(done)
            for k, each in zip(numbers, (each for job in jobs for each in job.result()), strict=True):
                made |= {k: each} if each is not None else {}
                if on_cage is not None:
                    on_cage(len(made), len(shapes))
            if len(made) == len(shapes) and sum(len(each.triangles) for each in made.values()) <= limit:
                return made, pixels
            pixels *= 2


def key_of(footprint: Footprint) -> tuple[object, ...]:
    """Return what a shape's triangles depend on of its footprint."""
    camera, views = footprint.projected, (footprint.views.tobytes(), footprint.sweeps.tobytes(), footprint.density)
    return (*views, camera.orthographic, camera.pixels_per_unit, camera.window, camera.sees_around)


def _dice_some(
    core: Dicer, cages: Sequence[tuple[SubdivisionMesh, Footprint, dict[str, object] | None]], dicing: Dicing
) -> list[DicedCage | None]:
    return [core.dice(core_arrays(cage, footprint, dicing, moved)) for cage, footprint, moved in cages]


def _warnings(cage: SubdivisionMesh, made: DicedCage, dicing: Dicing) -> Warnings:
    out: Warnings = []
    if made.level_limited and dicing.min_level < dicing.max_level:
        sentence = f"Edges cover more than {dicing.pixels:g} pixels even at level {dicing.max_level}, the finest."
        out.append(("dicing-limited", cage.path, sentence))
    if made.non_manifold_edges and getattr(cage, "normals", None) is None:
        sentence = f"{made.non_manifold_edges} edges do not join exactly two faces of the same winding: they are sharp."
        out.append(("cage-topology", cage.path, sentence))
    if made.unknown_creases:
        out.append(
            ("cage-topology", cage.path, f"Creases name {made.unknown_creases} edges that no face has: they are ignored.")
        )
    return out


def estimated_triangles(core: Dicer, cage: SubdivisionMesh | NurbsPatch, footprint: Footprint, pixels: float) -> int:
    """Return an estimate of the number of triangles with edges of `pixels`."""
    if isinstance(cage, NurbsPatch):
        return triangles_of(cage, footprint, Fineness(pixels, FLATNESS, MAX_LEVEL))
    return core.estimated_triangles(core_arrays(cage, footprint, Dicing(pixels)))


def core_arrays(
    cage: SubdivisionMesh, footprint: Footprint, dicing: Dicing, displacement: dict[str, object] | None = None
) -> dict[str, object]:
    """Return the arrays for the core's dice(); `displacement` is that of a DisplacedMesh."""
    dicing = dicing_of_cage(cage, dicing)
    channels = primvars_of(cage, Interpolation.CORNER)
    if isinstance(cage, DisplacedMesh) and cage.normals is not None:
        channels = [*channels, cage.normals]
    hidden = np.flatnonzero(cage.surface < 0).astype(np.int32) if isinstance(cage.surface, np.ndarray) else NO_INTS
    camera = footprint.projected
    return {
        "scheme": SCHEMES.index(cage.scheme),
        "boundary": BOUNDARIES.index(cage.interpolate_boundary),
        "smooth_triangles": cage.triangle_rule == "smooth",
        "face_varying_rule": FACE_VARYING_RULES.index(cage.face_varying_interpolation),
        "points": _floats(cage.points),
        "steps": NO_FLOATS if cage.motion is None else np.ascontiguousarray(cage.motion.points, np.float32).ravel(),
        "face_counts": _ints(cage.face_counts),
        "face_points": _ints(cage.face_points),
        "holes": np.concatenate([_ints(cage.holes), hidden]) if len(hidden) else _ints(cage.holes),
        "crease_lengths": _ints(cage.crease_lengths),
        "crease_points": _ints(cage.crease_points),
        "crease_sharpnesses": _floats(cage.crease_sharpnesses),
        "corner_points": _ints(cage.corner_points),
        "corner_sharpnesses": _floats(cage.corner_sharpnesses),
        "vertex_values": _side_by_side(primvars_of(cage, Interpolation.POINT), len(cage.points)),
        "varying_values": _side_by_side(primvars_of(cage, Interpolation.VARYING), len(cage.points)),
        "face_varying": [_face_varying_channel(p) for p in channels],
        "orthographic": camera.orthographic,
        "pixels_per_unit": camera.pixels_per_unit,
        "window": EVERYWHERE if camera.sees_around else camera.window,
        "outside": 1.0 if camera.sees_around else OUTSIDE,
        "views": np.ascontiguousarray(footprint.views, np.float64),
        "sweeps": np.ascontiguousarray(footprint.sweeps, np.float64),
        "density": footprint.density,
        "pixels": dicing.pixels,
        "flatness": dicing.flatness,
        "faces_differ": not isinstance(cage.surface, int) or bool(primvars_of(cage, Interpolation.FACE)),
        "min_level": dicing.min_level,
        "max_level": dicing.max_level,
        "max_triangles": dicing.max_triangles,
        "displacement": displacement,
    }


def primvars_of(cage: SubdivisionMesh, interpolation: Interpolation) -> list[Primvar]:
    """Return the colours and primvars of this interpolation, in the order in which the core returns them."""
    if cage.colors is None and not cage.primvars:
        return []
    every = [*([cage.colors] if cage.colors is not None else []), *cage.primvars]
    return [p for p in every if p.interpolation is interpolation]


def _ints(values: Ints | None) -> Ints:
    return NO_INTS if values is None else np.ascontiguousarray(values, np.int32)


def _floats(values: Floats | None) -> Floats:
    return NO_FLOATS if values is None else np.ascontiguousarray(values, np.float32)


def _side_by_side(primvars: Sequence[Primvar], points: int) -> Floats:
    if not primvars:
        return NO_COLUMNS
    return np.ascontiguousarray(np.concatenate([_rows(p) for p in primvars], axis=1), np.float32).reshape(points, -1)


def _rows(primvar: Primvar) -> Floats:
    return primvar.values if primvar.indices is None else primvar.values[primvar.indices]


def _face_varying_channel(primvar: Primvar) -> tuple[Ints, Floats]:
    indices = np.arange(len(primvar.values)) if primvar.indices is None else primvar.indices
    return np.ascontiguousarray(indices, np.int32), _floats(primvar.values)


def _mesh(cage: SubdivisionMesh, made: DicedCage) -> Mesh:
    triangles = made.triangles
    primvars = {id(p): _diced_primvar(p, k, cage, made) for p, k in primvar_places(cage)}
    normals = made.normals
    if len(made.normal_indices):
        normals = normals[made.normal_indices.ravel()]
    colors = None if cage.colors is None else primvars[id(cage.colors)]
    surface = cage.surface if isinstance(cage.surface, int) else np.asarray(cage.surface)[made.faces]
    points = len(made.points)
    rows = made.normal_indices.ravel() if len(made.normal_indices) else None
    if points == 3 * len(triangles) == len(normals) and rows is None:  # lengths must be unambiguous (description.Mesh)
        normals, rows = normals[triangles.ravel()], triangles.ravel()
    return Mesh(
        path=cage.path,
        points=made.points,
        triangles=triangles,
        normals=normals,
        colors=None if colors is None else _colors(colors, triangles, points),
        surface=surface,
        primvars=tuple(primvars[id(p)] for p in cage.primvars),
        light=cage.light,
        link_row=cage.link_row,
        motion=None if cage.motion is None else _motion(cage.motion, made, rows),
    )


def _motion(motion: PointMotion, made: DicedCage, rows: Ints | None) -> PointMotion:
    """Return the motion of the triangles; `rows` are the normals to take, in order (None: all)."""
    normals = np.stack(made.step_normals)
    return PointMotion(motion.times, np.stack(made.step_points), normals if rows is None else normals[:, rows])


def primvar_places(cage: SubdivisionMesh) -> list[tuple[Primvar, int]]:
    """Return colours and primvars with their place: the first column of POINT and VARYING ones, the channel of CORNER ones."""
    out: list[tuple[Primvar, int]] = []
    if cage.colors is None and not cage.primvars:
        return out
    for interpolation in Interpolation:
        place = 0
        for p in primvars_of(cage, interpolation):
            out.append((p, place))
            place += 1 if interpolation is Interpolation.CORNER else p.values.shape[1]
    return out


def _diced_primvar(primvar: Primvar, place: int, cage: SubdivisionMesh, made: DicedCage) -> Primvar:
    """Return the primvar on the diced triangles."""
    kind, width = primvar.interpolation, primvar.values.shape[1]
    if kind is Interpolation.CONSTANT:
        return primvar
    if kind is Interpolation.FACE:
        return Primvar(primvar.name, kind, _rows(primvar)[made.faces])
    if kind is Interpolation.CORNER:
        indices, values = made.face_varying[place]
        if len(values) == len(made.points) and np.array_equal(indices, made.triangles):
            return Primvar(primvar.name, Interpolation.POINT, values)  # no seams
        return Primvar(primvar.name, kind, values[indices.ravel()])
    columns = made.vertex_values if kind is Interpolation.POINT else made.varying_values
    return Primvar(primvar.name, Interpolation.POINT, np.ascontiguousarray(columns[:, place : place + width]))


def _colors(colors: Primvar, triangles: Ints, points: int) -> Floats:
    """Return the colours with a length that tells what they belong to (description.Mesh): per corner if two counts are
    equal."""
    values, kind = colors.values, colors.interpolation
    distinct = len({points, len(triangles), 3 * len(triangles)}) == 3
    if kind is Interpolation.CONSTANT:
        return np.repeat(values[:1], 3 * len(triangles), axis=0)
    if distinct or kind is Interpolation.CORNER:
        return values
    return values[triangles.ravel()] if kind is Interpolation.POINT else np.repeat(values, 3, axis=0)


def dice_patches_of(
    description: SceneDescription, dicing: Dicing, known: DicedBefore | None = None
) -> tuple[SceneDescription, Warnings]:
    """Return the description with every NurbsPatch diced to triangles, and warnings about coarser edges and trim loops without
    effect. `known`: as in `dice`."""
    patches = {k: s for k, s in enumerate(description.shapes) if isinstance(s, NurbsPatch)}
    if not patches:
        return description, []
    known = DicedBefore() if known is None else known
    fine = Fineness(dicing.pixels, dicing.flatness, dicing.max_level)
    prints = footprints(description, NurbsPatch, known.footprints[NurbsPatch])
    keys = {k: key_of(each) for k, each in prints.items()}

    def made_before(k: int, now: Fineness) -> DicedPatch | None:
        one = known.patches.get(k)
        return one.made if one is not None and one.is_of((patches[k],), (keys[k], now)) else None

    made, pixels = dice_patches(patches, prints, fine, dicing.max_triangles, made_before)
    warnings: Warnings = []
    if pixels > dicing.pixels:
        sentence = f"NURBS patches have edges of {pixels:g} pixels instead of {dicing.pixels:g}, to limit their triangles."
        warnings.append(("dicing-limited", "", sentence))
    shapes = list(description.shapes)
    known.patches = {}
    for k, patch in patches.items():
        found = made[k]
        shapes[k] = found.mesh
        known.patches[k] = DicedShape((patch,), (keys[k], replace(fine, pixels=pixels)), found, found.mesh)
        if found.is_limited:
            sentence = f"Edges cover more than {pixels:g} pixels even at level {dicing.max_level}, the finest."
            warnings.append(("dicing-limited", patch.path, sentence))
        if found.empty_loops:
            sentence = f"{found.empty_loops} of {len(patch.loops)} trim loops enclose no area: they are ignored."
            warnings.append(("nurbs-data", patch.path, sentence))
    return replace(description, shapes=tuple(shapes)), warnings


def dice_ribbons(description: SceneDescription, pixels: float, known: DicedBefore | None = None) -> SceneDescription:
    """Return the description with ribbons diced to edges of `pixels` along the curve. `known`: as in `dice`."""
    known = DicedBefore() if known is None else known
    prints = footprints(description, Ribbons, known.footprints[Ribbons])
    if not prints:
        return description
    shapes = list(description.shapes)
    before, known.ribbons = known.ribbons, {}
    for k, footprint in prints.items():
        ribbons = shapes[k]
        assert isinstance(ribbons, Ribbons)
        key, one = (key_of(footprint), pixels), before.get(k)
        is_known = one is not None and one.is_of((ribbons,), key)
        mesh = one.mesh if one is not None and is_known else strip(ribbons, quads_of(ribbons, footprint, pixels))
        shapes[k] = mesh
        known.ribbons[k] = DicedShape((ribbons,), key, None, mesh)
    return replace(description, shapes=tuple(shapes))
