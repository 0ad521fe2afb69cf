"""Upload of shapes to the core: meshes split by cut-outs and surfaces, curves and spheres.

Geometry that is too far away for single precision is left out, with a diagnostic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats, Ints
from ..description import Curves, Interpolation, Mesh, Placed, Primvar, Shape, Sphere, Surface
from ..description.geometry import is_paired
from ..description.motion import handed_over
from ..description.placement import transformed_boxes
from . import compiled
from .scene_record import SceneRecord, ShapeRows
from .single_precision import FARTHEST, OUTLYING, Flags, representable_triangles
from .surface_upload import SurfaceUpload, is_cutout, is_hole
from .volume_bounds import inset_points, inset_radius, volume_insets

if TYPE_CHECKING:
    from .light_upload import LightUpload

NO_FLOATS = np.zeros((0, 3), np.float32)
TOGETHER = 1 << 14  # plain meshes that are handed over at once


def matrix(m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.ascontiguousarray(m, np.float64)


@dataclass(frozen=True)
class Part:
    """A subset of a mesh's triangles with the values of their faces and corners. Points are all of the mesh's."""

    mesh: Mesh
    triangles: Ints
    surfaces: Ints  # one for all, or one for each triangle
    normals: tuple[Floats, str]  # values, and the name of their kind in the core's Attribute
    colors: tuple[Floats, str]
    primvars: tuple[Primvar, ...]
    step_normals: Floats | None = None  # (S + 1, rows of normals, 3), if they move


class ShapeUpload:
    """Uploads shapes to the builder's current group, in the core's order.

    Cut-out meshes follow other meshes, and moving ones are last.
    """

    def __init__(
        self,
        builder: compiled.SceneBuilder,
        inputs: SurfaceUpload,
        lights: LightUpload,
        surfaces: Sequence[Surface],
        shapes: Sequence[Shape],
        boxes: Doubles,  # around all their points
        warnings: list[tuple[str, str, str]],
        record: SceneRecord | None = None,
    ) -> None:
        self._builder = builder
        self._record = record
        self._inputs = inputs
        self._shapes = shapes
        self._boxes = boxes
        self._warnings = warnings
        self._lights = lights
        self._cutout = np.array([is_cutout(s) for s in surfaces], bool)
        self._hole = np.array([is_hole(s) for s in surfaces], bool)
        self._inset = volume_insets(surfaces) if any(not s.interface for s in surfaces) else None
        self._center = np.zeros(3)
        self._link_row = 0
        self._kinds = {type(s) for s in shapes}
        self._moving = any(isinstance(s, Mesh | Curves) and s.motion is not None for s in shapes)
        self._paired = {i for i, s in enumerate(shapes) if isinstance(s, Mesh) and is_paired(s.triangles)}
        self._rows: list[int] = []
        self.shape_rows = ShapeRows()
        self._alone = np.arange(len(surfaces), dtype=np.int32)[:, None]  # for meshes with one surface

    def add(self, placed: Sequence[Placed], center: Doubles, scale: float) -> None:
        """Add shapes to the current group, whose coordinates are relative to `center` and scaled by `scale`."""
        near = self._near(placed, center, scale)
        self._center = center
        self._rows = [-1] * len(placed)
        lights: dict[int, int] = {}  # the builder's numbers, by index in `placed`: each placement is a light of its own
        plain: list[tuple[int, Placed]] = []
        for i, p in self._in_order(placed):
            shape = self._shapes[p.shape]
            if isinstance(shape, Mesh) and i not in near and self._is_plain(shape):
                plain.append((i, p))
                if len(plain) == TOGETHER:
                    self._add_plain(plain)
                continue
            self._add_plain(plain)
            if shape.light is not None:
                lights[i] = self._lights.add_mesh_light(shape.light, matrix(p.matrix))
            if isinstance(shape, Mesh):
                if shape.motion is None:
                    first = self._builder.mesh_rows
                    self._add_part(shape, matrix(p.matrix), near.get(i), lights.get(i), cutout=False)
                    if self._builder.mesh_rows > first and i not in near and shape.light is None:
                        self._rows[i] = first
                    self._note_mesh(p)
            elif i not in near and not (isinstance(shape, Curves) and shape.motion is not None):
                self._add_curved(shape, matrix(p.matrix), lights.get(i))
                self._note_curved(p)
        self._add_plain(plain)
        for cutout, moving in ((True, False), (False, True), (True, True)):
            if (cutout and not self._cutout.any()) or (moving and not self._moving):
                continue
            for i, p in enumerate(placed):
                shape = self._shapes[p.shape]
                if isinstance(shape, Mesh) and (shape.motion is not None) == moving:
                    self._rows[i] = -1 if self._has_cutout(shape) else self._rows[i]
                    self._add_part(shape, matrix(p.matrix), near.get(i), lights.get(i), cutout=cutout)
                    self._note_mesh(p)
                elif moving and not cutout and isinstance(shape, Curves) and shape.motion is not None and i not in near:
                    self._add_curved(shape, matrix(p.matrix), lights.get(i))
                    self._note_curved(p)

    def _is_plain(self, mesh: Mesh) -> bool:
        """Return whether a mesh is one row of the core with nothing but triangles, and may be added along with others."""
        return (
            mesh.normals is None
            and mesh.colors is None
            and not mesh.primvars
            and mesh.motion is None
            and mesh.light is None
            and isinstance(mesh.surface, int)
            and not (self._cutout[mesh.surface] or self._hole[mesh.surface])
            and mesh.link_row == self._link_row
            and self._inset is None
            and len(mesh.triangles) > 0
        )

    def _add_plain(self, plain: list[tuple[int, Placed]]) -> None:
        """Add meshes that are plain at once, and empty the list."""
        if not plain:
            return
        row, shapes = self._builder.mesh_rows, (self._shapes[p.shape] for _, p in plain)
        meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
        surfaces = np.array([mesh.surface for mesh in meshes], np.int32)
        points, triangles = [mesh.points for mesh in meshes], [mesh.triangles for mesh in meshes]
        matrices = np.array([p.matrix for _, p in plain], np.float64)
        self._builder.add_plain_meshes(points, triangles, surfaces, matrices)
        for (i, p), mesh in zip(plain, meshes, strict=True):
            self._rows[i], row = row, row + 1
            self.shape_rows.note_mesh(row, mesh.path)
            if self._record is not None:
                self._record.note_shape(self._record.meshes, p.shape, p.instance, row)
        plain.clear()

    def rows_of_last(self) -> list[int]:
        """Return the builder's first row of each shape that was added last; -1 unless it is one plain mesh.

        A plain mesh is whole, does not move, has no cut-out and is no light.
        """
        return self._rows

    def _has_cutout(self, mesh: Mesh) -> bool:
        return bool(self._cutout[np.asarray(mesh.surface)].any())

    def _in_order(self, placed: Sequence[Placed]) -> Iterable[tuple[int, Placed]]:
        """Return shapes with their indices in the core's order: meshes of paired triangles first, then one kind after
        another."""
        kinds = {kind: order for order, kind in enumerate((*CURVED, Curves)) if kind in self._kinds}
        if not self._paired and len(kinds) < 2:
            return enumerate(placed)

        def order(p: tuple[int, Placed]) -> tuple[bool, int]:
            return p[1].shape not in self._paired, kinds.get(type(self._shapes[p[1].shape]), 0)

        return sorted(enumerate(placed), key=order)

    def _note_mesh(self, placed: Placed) -> None:
        self.shape_rows.note_mesh(self._builder.mesh_rows, self._shapes[placed.shape].path)
        if self._record is not None:
            self._record.note_shape(self._record.meshes, placed.shape, placed.instance, self._builder.mesh_rows)

    def _note_curved(self, placed: Placed) -> None:
        self.shape_rows.note_curved(self._builder.curved_rows, self._shapes[placed.shape].path)
        if self._record is not None:
            self._record.note_shape(self._record.curved, placed.shape, placed.instance, self._builder.curved_rows)

    def _near(self, placed: Sequence[Placed], center: Doubles, scale: float) -> dict[int, Flags]:
        """Return the triangles to keep, by index, of shapes that are too far away in part; report the rest."""
        if not placed:
            return {}
        own = self._boxes[[p.shape for p in placed]]
        with np.errstate(over="ignore", invalid="ignore"):
            low, high = transformed_boxes(np.array([p.matrix for p in placed]), own[:, 0], own[:, 1])
            reach = np.maximum(np.abs(low - center), np.abs(high - center)).max(axis=1) * scale
        near: dict[int, Flags] = {}
        for i in np.flatnonzero(~(reach < OUTLYING)).tolist():
            shape = self._shapes[placed[i].shape]
            if isinstance(shape, Mesh):
                kept, blurred = representable_triangles(shape, core_from_object(placed[i].matrix, center, scale))
                if not kept.all():
                    near[i] = kept
                    lost = f"{int((~kept).sum())} of {len(kept)} triangles are too large or too far away to be drawn"
                    self._warnings.append(("too-far", shape.path, lost))
                if blurred:
                    message = f"{blurred} of {len(kept)} triangles are so large that single precision blurs their edges"
                    self._warnings.append(("far-edges", shape.path, message))
            elif not reach[i] < FARTHEST:
                near[i] = np.zeros(0, bool)
                message = f"The {type(shape).__name__.lower()} is too large or too far away to be drawn"
                self._warnings.append(("too-far", shape.path, message))
        return near

    def _add_curved(self, shape: Shape, world_from_object: npt.NDArray[np.float64], light: int | None) -> None:
        kind = type(shape)
        if kind not in (*CURVED, Curves):
            raise ValueError(f"{shape.path} is not diced")
        if isinstance(shape.surface, int) and self._hole[shape.surface]:
            return
        self._set_link_row(shape)
        if isinstance(shape, Sphere) and self._inset is not None and self._inset[shape.surface] > 0:
            inset = float(self._inset[shape.surface])
            shape = replace(shape, radius=inset_radius(shape.radius, inset, world_from_object, self._center))
        if isinstance(shape, Curves):
            add_curves(self._builder, shape, self._hole, world_from_object)
        elif not CURVED[kind](self._builder, shape, world_from_object):
            message = f"A {kind.__name__.lower()} with a singular matrix is left out"
            self._warnings.append(("singular-transform", shape.path, message))
        for name, kind_of, width, values in self._inputs.primvars(shape.primvars):
            self._builder.add_curved_primvar(name, kind_of, width, values)
        if light is not None:
            self._builder.set_light_of_shape(light, world_from_object)

    def _set_link_row(self, shape: Shape) -> None:
        """Set the light linking row of the shapes that follow, where it changes."""
        if shape.link_row != self._link_row:
            self._link_row = shape.link_row
            self._builder.set_link_row(shape.link_row)

    def _add_part(
        self, mesh: Mesh, world_from_object: npt.NDArray[np.float64], near: Flags | None, light: int | None, *, cutout: bool
    ) -> None:
        if isinstance(mesh.surface, int):
            if self._cutout[mesh.surface] == cutout and not self._hole[mesh.surface]:
                part = whole_part(mesh, self._alone[mesh.surface])
                self._add_mesh(part if near is None else selected_part(part, near), world_from_object, light, cutout)
            return
        surfaces = np.atleast_1d(np.asarray(mesh.surface, np.int32))
        wanted = (self._cutout[surfaces] == cutout) & ~self._hole[surfaces]
        if near is not None:
            wanted &= near
        if not wanted.any():
            return
        part = whole_part(mesh, surfaces) if wanted.all() else selected_part(whole_part(mesh, surfaces), wanted)
        self._add_mesh(part, world_from_object, light, cutout)

    def _points_of(self, part: Part, world_from_object: Doubles) -> Floats:
        """Return the mesh's points, with the boundaries of volumes moved inwards."""
        if self._inset is None or part.mesh.motion is not None:
            return part.mesh.points
        inset = np.broadcast_to(self._inset[part.surfaces], len(part.triangles))
        if not inset.any():
            return part.mesh.points
        return inset_points(part.mesh.points, part.triangles, inset, world_from_object, self._center)

    def _add_mesh(self, part: Part, world_from_object: npt.NDArray[np.float64], light: int | None, cutout: bool) -> None:
        self._set_link_row(part.mesh)
        mesh = compiled.MeshInput()
        mesh.points, mesh.triangles, mesh.surfaces = self._points_of(part, world_from_object), part.triangles, part.surfaces
        mesh.normals, mesh.normal_kind = part.normals[0], compiled.Attribute[part.normals[1]]
        mesh.colors, mesh.color_kind = part.colors[0], compiled.Attribute[part.colors[1]]
        mesh.cutout = cutout
        if (motion := part.mesh.motion) is not None:
            mesh.times, mesh.step_points = handed_over(motion.times), np.ascontiguousarray(motion.points, np.float32)
            if part.step_normals is not None:
                mesh.step_normals = np.ascontiguousarray(part.step_normals, np.float32)
        self._builder.add_mesh(mesh, world_from_object)
        for name, number, width, values in self._inputs.primvars(part.primvars):
            self._builder.add_mesh_primvar(name, number, width, values)
        if light is not None:
            self._builder.set_light_of_shape(light, world_from_object)


def add_sphere(builder: compiled.SceneBuilder, sphere: Shape, world_from_object: Doubles) -> bool:
    """Add a sphere; return whether it was added or is empty."""
    assert isinstance(sphere, Sphere)
    return builder.add_sphere(sphere.radius, sphere.surface, world_from_object) or sphere.radius == 0


def add_curves(builder: compiled.SceneBuilder, curves: Curves, holes: Flags, world_from_object: Doubles) -> None:
    surfaces = np.atleast_1d(np.asarray(curves.surface, np.int32))
    made = compiled.CurvesInput()
    made.points = np.ascontiguousarray(curves.controls, np.float32)
    made.segments = np.ascontiguousarray(curves.segments, np.int32)
    made.surfaces = np.where((surfaces >= 0) & holes[surfaces], np.int32(-1), surfaces)
    made.closed, made.joined = curves.closed, curves.joined
    if (motion := curves.motion) is not None:
        made.times, made.step_points = handed_over(motion.times), np.ascontiguousarray(motion.points, np.float32)
    builder.add_curves(made, world_from_object)


# Upload functions of shapes that are neither triangles nor curves, by type.
CURVED: dict[type[Shape], Callable[[compiled.SceneBuilder, Shape, Doubles], bool]] = {Sphere: add_sphere}


def core_from_object(world_from_object: Doubles, center: Doubles, scale: float) -> Doubles:
    m = world_from_object * scale
    m[:3, 3] -= center * scale
    return m


def whole_part(mesh: Mesh, surfaces: Ints) -> Part:
    points, triangles = len(mesh.points), len(mesh.triangles)
    normals = (
        NO_FLOATS if mesh.normals is None else mesh.normals,
        attribute_kind(mesh.normals, points, triangles, normals=True),
    )
    colors = (NO_FLOATS if mesh.colors is None else mesh.colors, attribute_kind(mesh.colors, points, triangles, normals=False))
    step_normals = None if mesh.motion is None or mesh.normals is None else mesh.motion.normals
    return Part(
        mesh=mesh,
        triangles=mesh.triangles,
        surfaces=surfaces,
        normals=normals,
        colors=colors,
        primvars=mesh.primvars,
        step_normals=step_normals,
    )


def selected_part(p: Part, wanted: npt.NDArray[np.bool_]) -> Part:
    """Return the part with the `wanted` triangles only."""
    corners = np.repeat(wanted, 3)
    rows = {"TRIANGLE": wanted, "CORNER": corners}

    def values(of: tuple[Floats, str]) -> tuple[Floats, str]:
        return (np.ascontiguousarray(of[0][rows[of[1]]]) if of[1] in rows else of[0]), of[1]

    def primvar(of: Primvar) -> Primvar:
        rows = {Interpolation.FACE: wanted, Interpolation.CORNER: corners}
        return replace(of, values=of.values[rows[of.interpolation]]) if of.interpolation in rows else of

    return replace(
        p,
        triangles=np.ascontiguousarray(p.triangles[wanted]),
        surfaces=p.surfaces[wanted] if len(p.surfaces) == len(wanted) else p.surfaces,
        normals=values(p.normals),
        colors=values(p.colors),
        primvars=tuple(primvar(v) for v in p.primvars),
        step_normals=p.step_normals[:, corners] if p.step_normals is not None and p.normals[1] == "CORNER" else p.step_normals,
    )


def attribute_kind(values: npt.NDArray[np.float32] | None, points: int, triangles: int, *, normals: bool) -> str:
    """Return which elements an attribute's values belong to, judged by their number: corners before points before triangles."""
    if values is None:
        return "NONE"
    n = len(values)
    if n == 3 * triangles:
        return "CORNER"
    if n == points:
        return "VERTEX"
    if n == triangles and not normals:
        return "TRIANGLE"
    raise ValueError(f"{n} values for {points} points and {triangles} triangles")
