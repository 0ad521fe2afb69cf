"""Upload of displacement to the core, for dicing only: textures, patterns and primvars, as surfaces read them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..arrays import Doubles, Floats
from ..description import (
    DisplacedMesh,
    Input,
    Interpolation,
    PatternInput,
    Primvar,
    PrimvarInput,
    SceneDescription,
    Surface,
    TextureInput,
)
from ..description.shading import DISPLACEMENTS, reads_world_space
from ..tessellation.dice import Warnings, primvar_places, primvars_of
from . import compiled
from .surface_upload import SurfaceUpload, Textures, channels_of

# Enumerators in the order of the core's (displacer.hpp, mover.hpp).
_KINDS = (Interpolation.CONSTANT, Interpolation.FACE, Interpolation.POINT, Interpolation.VARYING, Interpolation.CORNER)
_PLACES = (None, Interpolation.POINT, Interpolation.VARYING, Interpolation.CORNER)
_STILL = 0  # the core's first surface: not displaced
_NO_PRIMVAR = ""
_TANGENTS = "st"
_CARRIER = "emissive_color"  # an input of three unbounded numbers, whose slot carries the displacement


def displacements(description: SceneDescription, textures: Textures | Callable[[], Textures]) -> Displacements | None:
    """Return the displacement of all displaced shapes; None if there are none. `textures` may be a function, which is called
    once they are needed."""
    if not any(isinstance(shape, DisplacedMesh) for shape in description.shapes):
        return None
    return Displacements(description, textures)


class Displacements:
    def __init__(self, description: SceneDescription, textures: Textures | Callable[[], Textures]) -> None:
        self._description = description
        self._textures = textures
        self._places = _single_placements(description)
        self._notes: Warnings = []

    @property
    def warnings(self) -> Warnings:
        return [*self._surfaces.warnings, *self._notes]

    @cached_property
    def _surfaces(self) -> _DisplacingSurfaces:
        return _DisplacingSurfaces(self._description, self._textures() if callable(self._textures) else self._textures)

    def depends_on(self, number: int, shape: DisplacedMesh) -> tuple[tuple[object, ...], object]:
        """Return the surfaces that a shape wears, and its place and the time, which patterns may read."""
        surfaces = self._description.surfaces
        worn = tuple(surfaces[i] for i in np.unique(shape.surface).tolist() if i >= 0)
        matrix = self._places.get(number)
        return worn, (None if matrix is None else matrix.tobytes(), self._description.time_code)

    def of(self, number: int, shape: DisplacedMesh) -> dict[str, object]:
        """Return what the core's dice() reads for the displaced shape with index `number` in the description."""
        matrix, moving = self._places.get(number), self._surfaces
        numbers = np.atleast_1d(moving.numbers[np.asarray(shape.surface)])
        if matrix is None:
            self._note_space(shape)
        placed = primvar_places(shape)
        read = [
            (p, at, name) for p, at in placed if p is not shape.colors and (name := moving.upload.number_of(p.name)) is not None
        ]
        return {
            "displacer": moving.displacer,
            "surfaces": np.ascontiguousarray(numbers, np.int32),
            "world_from_object": np.ascontiguousarray(np.eye(4) if matrix is None else matrix, np.float64),
            "primvars": [_cage_primvar(p, at, name) for p, at, name in read],
            "st": next((_value_place(p, at) for p, at in placed if p.name == _TANGENTS and p.values.shape[1] >= 2), (0, 0)),
            "normals": -1 if shape.normals is None else len(primvars_of(shape, Interpolation.CORNER)),
        }

    def _note_space(self, shape: DisplacedMesh) -> None:
        for i in np.unique(shape.surface).tolist():
            surface = self._description.surfaces[i]
            value = surface.displacement[1] if i >= 0 and surface.displacement is not None else None
            pattern = surface.pattern if isinstance(value, PatternInput) else None
            if pattern is not None and isinstance(value, PatternInput) and reads_world_space(pattern, value.source.node):
                message = f"{surface.path} reads world space, but the shape has several instances: object space is used."
                self._notes.append(("displacement-space", shape.path, message))


class _DisplacingSurfaces:
    """The surfaces that displace shapes, in the core. `numbers`: the core's, by the description's index."""

    def __init__(self, description: SceneDescription, textures: Textures) -> None:
        self.warnings: Warnings = []
        self.displacer = compiled.Displacer()
        surfaces = description.surfaces
        worn = {i for s in description.shapes if isinstance(s, DisplacedMesh) for i in np.unique(s.surface).tolist() if i >= 0}
        moving = [i for i in sorted(worn) if surfaces[i].displacement is not None]
        self.upload = SurfaceUpload(
            self.displacer, {file: list(tiles) for file, tiles in textures.items()}, description.time_code or 0.0
        )
        taken = self.upload.add_surfaces([Surface(""), *(_displacement_surface(surfaces[i], textures) for i in moving)])
        self.upload.add_images()
        self.numbers = np.zeros(max(len(surfaces), 1) + 1, np.int32)  # the last one: faces that are not drawn
        directions = [_STILL]
        for number, i in enumerate(moving, start=1):
            found = surfaces[i].displacement
            assert found is not None
            directions.append(1 + DISPLACEMENTS.index(found[0]))
            self.numbers[i] = number
            if not taken[number].inputs:
                self._note(surfaces[i].path)
        self.displacer.set_directions(directions)

    def _note(self, path: str) -> None:
        said = next((message for _, at, message in self.upload.warnings if at == path), "")
        why = said.partition(". ")[0] or "Its displacement cannot be read"
        self.warnings.append(("displacement", path, f"{why}. The surface is rendered without displacement."))


def _displacement_surface(surface: Surface, textures: Textures) -> Surface:
    """Return a surface with this surface's displacement and nothing else."""
    assert surface.displacement is not None
    value: Input = surface.displacement[1]
    if isinstance(value, TextureInput) and not textures.get(value.file):
        value = PrimvarInput(_NO_PRIMVAR, channels_of(value.fallback, value.channels))
    pattern = surface.pattern if isinstance(value, PatternInput) else None
    return Surface(surface.path, inputs=((_CARRIER, value),), pattern=pattern)


def _single_placements(description: SceneDescription) -> dict[int, Doubles]:
    """Return the matrices, by shape index, of shapes that are placed exactly once."""
    inside = {placed.shape for prototype in description.prototypes for placed in prototype.shapes}
    found: dict[int, Doubles] = {}
    for placed in description.static:
        if placed.shape in found:
            inside.add(placed.shape)
        found[placed.shape] = placed.matrix
    return {shape: matrix for shape, matrix in found.items() if shape not in inside and np.linalg.det(matrix[:3, :3]) != 0}


def _cage_primvar(primvar: Primvar, at: int, name: int) -> dict[str, object]:
    kind = primvar.interpolation
    values: Floats = primvar.values
    if kind is Interpolation.FACE and primvar.indices is not None:
        values = values[primvar.indices]
    given = values if kind in (Interpolation.CONSTANT, Interpolation.FACE) else values[:0]
    return {
        "name": name,
        "kind": _KINDS.index(kind),
        "at": at,
        "width": values.shape[1],
        "values": np.ascontiguousarray(np.where(np.isfinite(given), given, 0), np.float32),
    }


def _value_place(primvar: Primvar, at: int) -> tuple[int, int]:
    """Return the core's ValuePlace; tangents need a primvar that varies over faces."""
    kind = primvar.interpolation
    return (_PLACES.index(kind), at) if kind in _PLACES else (0, 0)
