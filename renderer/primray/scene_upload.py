"""Hands a SceneDescription to the core's builder: chooses origin and scale, merges what is static, counts what is left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from .description import (
    Camera,
    Doubles,
    Floats,
    Interpolation,
    Ints,
    LightType,
    Mesh,
    Placed,
    Placement,
    Primvar,
    Projection,
    SceneDescription,
    Shape,
    Sphere,
    Surface,
    TextureFile,
)
from .far_geometry import FARTHEST, OUTLYING, FarInstances, Flags, near_triangles, usual_boxes, usual_union
from .placement import Box, chunks, placed_box, transformed_box, transformed_boxes
from .skewed import bake_skewed
from .surface_upload import MutableTextures, SurfaceUpload, Textures, is_cutout, is_hole

# Order of LightType in light/light.hpp.
LIGHT_NUMBERS = {
    LightType.POINT: 0,
    LightType.SPHERE: 1,
    LightType.DISK: 2,
    LightType.RECT: 3,
    LightType.CYLINDER: 4,
    LightType.DISTANT: 5,
    LightType.DOME: 6,
}
# Order of Attribute in scene/scene.hpp.
NONE, PER_TRIANGLE, PER_VERTEX, PER_CORNER = range(4)

NO_FLOATS = np.zeros((0, 3), np.float32)
NO_TEXTURE = np.zeros((0, 0, 3), np.float32)


def upload(
    core: Any,
    description: SceneDescription,
    textures: MutableTextures,
    filter_width: float,
    filter_inverse_cdf: npt.NDArray[np.float32],
    shapes: list[Shape] | None = None,
) -> tuple[Any, list[tuple[str, str, str]]]:
    """The core's Scene, and (code, prim path, message) of what could not be taken along. Empties `textures` to save memory.

    `shapes`, where given, takes the place of the description's: emptied when the core has copies, before it accelerates these.
    """
    shapes = list(description.shapes) if shapes is None else shapes
    d = bake_skewed(description, shapes)
    full_boxes = shape_boxes(core, shapes)
    boxes = usual_boxes(full_boxes, shapes)
    prototype_boxes = boxes_of_prototypes(d, boxes)
    origin = d.camera.world_from_camera[:3, 3]
    scale = power_of_two_scale(scene_reach(d, boxes, prototype_boxes, origin))
    builder = core.SceneBuilder(origin, scale)
    inputs = SurfaceUpload(builder, textures)
    builder.reserve_triangles(*points_and_triangles(shapes))
    warnings: list[tuple[str, str, str]] = []
    handing = ShapeUpload(builder, inputs, inputs.add_surfaces(d.surfaces), shapes, full_boxes, warnings)
    handing.add(d.static, origin, scale)
    builder.reserve_instances(sum(map(len, [*d.placements, *(p for proto in d.prototypes for p in proto.placements)])))
    numbers: dict[int, int] = {}
    placements = PlacementUpload(builder, inputs, d, numbers, warnings)
    # Prototypes of placements last: what they place has its number by then.
    for i, proto in sorted(enumerate(d.prototypes), key=lambda item: bool(item[1].placements)):
        low, high = prototype_boxes[i]
        center, unit = (low + high) / 2, power_of_two_scale(float(np.max(high - low)) / 2)
        numbers[i] = builder.begin_prototype(center, unit)
        handing.add(proto.shapes, center, unit)
        placements.add(proto.placements, numbers[i], center, unit, prototype_boxes)
    placements.add(d.placements, 0, origin, scale, prototype_boxes)
    for light in d.lights:
        builder.add_light(
            LIGHT_NUMBERS[light.type],
            matrix(light.world_from_light),
            light.emission,
            light.width,
            light.height,
            light.radius,
            light.length,
            light.angle_deg,
            light.diffuse,
            light.specular,
            dome_pixels(light.texture, textures),
        )
    set_camera(builder, d.camera, d.resolution, filter_width, filter_inverse_cdf)
    inputs.add_images()
    shapes.clear()
    scene = builder.finish()
    if scene.unsampled_emitters:
        message = f"{scene.unsampled_emitters} instances that emit are too many to be sampled as lights: expect noise"
        warnings.append(("emitters-unsampled", "", message))
    return scene, warnings


@dataclass(frozen=True)
class PlacementUpload:
    """Placements with their instances' primvars; notes what cannot be taken along in `warnings`."""

    builder: Any
    inputs: SurfaceUpload
    description: SceneDescription
    numbers: Mapping[int, int]  # the core's, by prototype
    warnings: list[tuple[str, str, str]]

    def add(
        self, placements: Sequence[Placement], parent: int, center: Doubles, scale: float, prototype_boxes: Sequence[Box]
    ) -> None:
        """Into the group `parent`, 0 being the world."""
        for placement in placements:
            path = self.description.prototypes[placement.prototype].path
            box = prototype_boxes[placement.prototype]
            with np.errstate(over="ignore", invalid="ignore"):
                reach = _reach(placed_box(placement.levels, box), center) * scale
            far = None if reach < FARTHEST else FarInstances(box, center, FARTHEST / scale)
            left_out = add_placement(self.builder, placement, parent, self.numbers[placement.prototype], far)
            for name, _, width, values in self.inputs.primvars(placement.primvars):
                kept = np.delete(values, left_out, axis=0) if len(left_out) else values
                self.builder.add_placement_primvar(name, width, kept)
            gone = far.count(placement) if far else 0
            if gone:
                self.warnings.append(("too-far", path, f"{gone} instances are too large or too far away to be drawn"))
            if len(left_out) > gone:
                message = f"{len(left_out) - gone} instances have a singular or non-finite matrix and are left out"
                self.warnings.append(("singular-transform", path, message))


def add_placement(
    builder: Any, placement: Placement, parent: int, prototype: int, far: FarInstances | None = None
) -> npt.NDArray[np.int64]:
    """Which of its instances are left out: the core has no row for them."""
    builder.begin_placement(parent, prototype)
    left_out, start = [np.zeros(0, np.int64)], 0
    for rows in placement.chunks():
        left_out.append(builder.add_instances(rows if far is None else far.removed(rows)) + start)
        start += len(rows)
    builder.end_placement()
    return np.concatenate(left_out)


def set_camera(
    builder: Any, c: Camera, resolution: tuple[int, int], filter_width: float, inverse_cdf: npt.NDArray[np.float32]
) -> None:
    near, far = c.clipping_range
    builder.set_camera(
        matrix(c.world_from_camera),
        c.projection is Projection.ORTHOGRAPHIC,
        c.window,
        near,
        far,
        c.lens_radius,
        c.focus_distance,
        *resolution,
        filter_width,
        inverse_cdf,
    )


def dome_pixels(file: TextureFile | None, textures: Textures) -> Floats:
    """(H, W, 3), or no pixels: a light without a texture is constant."""
    tiles = [] if file is None else textures.get(file, [])
    if not tiles:
        return NO_TEXTURE
    return tiles[0][1].rgb()


def matrix(m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.ascontiguousarray(m, np.float64)


@dataclass(frozen=True)
class Part:
    """A mesh's triangles of one sort, with what belongs to each of them or to its corners. Points are all of the mesh's."""

    mesh: Mesh
    triangles: Ints
    surfaces: Ints  # one, or one a triangle
    normals: tuple[Floats, int]  # values and kind
    colors: tuple[Floats, int]
    primvars: tuple[Primvar, ...]


class ShapeUpload:
    """Shapes for the builder's current group: its cut-outs after its other meshes, as the core wants them."""

    def __init__(
        self,
        builder: Any,
        inputs: SurfaceUpload,
        surfaces: Sequence[Surface],
        shapes: Sequence[Shape],
        boxes: Doubles,  # of all their points
        warnings: list[tuple[str, str, str]],
    ) -> None:
        self._builder = builder
        self._inputs = inputs
        self._shapes = shapes
        self._boxes = boxes
        self._warnings = warnings
        self._cutout = np.array([is_cutout(s) for s in surfaces], bool)
        self._hole = np.array([is_hole(s) for s in surfaces], bool)
        self._alone = np.arange(len(surfaces), dtype=np.int32)[:, None]  # of meshes that have one

    def add(self, placed: Sequence[Placed], center: Doubles, scale: float) -> None:
        """Into the current group, whose lengths are `scale` times those from `center`."""
        near = self._near(placed, center, scale)
        for i, p in enumerate(placed):
            shape = self._shapes[p.shape]
            if isinstance(shape, Mesh):
                self._add_part(shape, matrix(p.matrix), near.get(i), cutout=False)
            elif not isinstance(shape, Sphere):
                raise ValueError(f"{shape.path} is not diced")
            elif i not in near:
                self._add_sphere(shape, matrix(p.matrix))
        for i, p in enumerate(placed) if self._cutout.any() else []:
            shape = self._shapes[p.shape]
            if isinstance(shape, Mesh):
                self._add_part(shape, matrix(p.matrix), near.get(i), cutout=True)

    def _near(self, placed: Sequence[Placed], center: Doubles, scale: float) -> dict[int, Flags]:
        """By number, of shapes that are too far away in part: the triangles that are not. Notes what is."""
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
                kept, blurred = near_triangles(shape, core_from_object(placed[i].matrix, center, scale))
                if not kept.all():
                    near[i] = kept
                    lost = f"{int((~kept).sum())} of {len(kept)} triangles are too large or too far away to be drawn"
                    self._warnings.append(("too-far", shape.path, lost))
                if blurred:
                    message = f"{blurred} of {len(kept)} triangles reach so far that floats blur their edges"
                    self._warnings.append(("far-edges", shape.path, message))
            elif not reach[i] < FARTHEST:
                near[i] = np.zeros(0, bool)
                self._warnings.append(("too-far", shape.path, "The sphere is too large or too far away to be drawn"))
        return near

    def _add_sphere(self, sphere: Sphere, world_from_object: npt.NDArray[np.float64]) -> None:
        if self._hole[sphere.surface]:
            return
        if not self._builder.add_sphere(sphere.radius, sphere.surface, world_from_object) and sphere.radius != 0:
            self._warnings.append(("singular-transform", sphere.path, "A sphere with a singular matrix is left out"))
        for name, _, width, values in self._inputs.primvars(sphere.primvars):
            self._builder.add_sphere_primvar(name, width, values)

    def _add_part(self, mesh: Mesh, world_from_object: npt.NDArray[np.float64], near: Flags | None, *, cutout: bool) -> None:
        if isinstance(mesh.surface, int):
            if self._cutout[mesh.surface] == cutout and not self._hole[mesh.surface]:
                part = whole(mesh, self._alone[mesh.surface])
                self._add_mesh(part if near is None else part_of(part, near), world_from_object, cutout)
            return
        surfaces = np.atleast_1d(np.asarray(mesh.surface, np.int32))
        wanted = (self._cutout[surfaces] == cutout) & ~self._hole[surfaces]
        if near is not None:
            wanted &= near
        if not wanted.any():
            return
        part = whole(mesh, surfaces) if wanted.all() else part_of(whole(mesh, surfaces), wanted)
        self._add_mesh(part, world_from_object, cutout)

    def _add_mesh(self, part: Part, world_from_object: npt.NDArray[np.float64], cutout: bool) -> None:
        self._builder.add_mesh(
            part.mesh.points, part.triangles, *part.normals, *part.colors, part.surfaces, world_from_object, cutout
        )  # fmt: skip
        for name, number, width, values in self._inputs.primvars(part.primvars):
            self._builder.add_mesh_primvar(name, number, width, values)


def core_from_object(world_from_object: Doubles, center: Doubles, scale: float) -> Doubles:
    m = world_from_object * scale
    m[:3, 3] -= center * scale
    return m


def whole(mesh: Mesh, surfaces: Ints) -> Part:
    points, triangles = len(mesh.points), len(mesh.triangles)
    normals = (NO_FLOATS if mesh.normals is None else mesh.normals, kind(mesh.normals, points, triangles, normals=True))
    colors = (NO_FLOATS if mesh.colors is None else mesh.colors, kind(mesh.colors, points, triangles, normals=False))
    return Part(mesh, mesh.triangles, surfaces, normals, colors, mesh.primvars)


def part_of(p: Part, wanted: npt.NDArray[np.bool_]) -> Part:
    """The triangles that are `wanted`."""
    corners = np.repeat(wanted, 3)
    rows = {PER_TRIANGLE: wanted, PER_CORNER: corners}

    def values(of: tuple[Floats, int]) -> tuple[Floats, int]:
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
    )


def kind(values: npt.NDArray[np.float32] | None, points: int, triangles: int, *, normals: bool) -> int:
    """Which elements an attribute's rows belong to, by their number: corners before points before triangles."""
    if values is None:
        return NONE
    n = len(values)
    if n == 3 * triangles:
        return PER_CORNER
    if n == points:
        return PER_VERTEX
    if n == triangles and not normals:
        return PER_TRIANGLE
    raise ValueError(f"{n} values for {points} points and {triangles} triangles")


def shape_boxes(core: Any, shapes: Sequence[Shape]) -> Doubles:
    """(S, 2, 3): low and high corners, each in its own space."""
    boxes: Doubles = core.boxes([NO_FLOATS if isinstance(s, Sphere) else s.points for s in shapes])
    for k, shape in enumerate(shapes):
        if isinstance(shape, Sphere):
            boxes[k] = [[-abs(shape.radius)] * 3, [abs(shape.radius)] * 3]
    return boxes


def union(boxes: Sequence[Box]) -> Box:
    if not boxes:
        return np.zeros(3), np.zeros(3)
    return np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)


def points_and_triangles(shapes: Sequence[Shape]) -> tuple[int, int]:
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    return sum(len(mesh.points) for mesh in meshes), sum(len(mesh.triangles) for mesh in meshes)


def boxes_of_prototypes(d: SceneDescription, boxes: Doubles) -> list[Box]:
    """Each in its own space."""
    leaves = [
        usual_union(np.array([transformed_box(p.matrix, (boxes[p.shape, 0], boxes[p.shape, 1])) for p in proto.shapes]))
        for proto in d.prototypes
    ]
    return [
        union([placed_box(p.levels, leaves[p.prototype]) for p in proto.placements]) if proto.placements else leaf
        for proto, leaf in zip(d.prototypes, leaves, strict=True)
    ]


def scene_reach(d: SceneDescription, boxes: Doubles, prototype_boxes: list[Box], origin: npt.NDArray[np.float64]) -> float:
    """Largest coordinate distance of any geometry from the origin, of a few outliers left aside; 0 for an empty scene."""
    with np.errstate(invalid="ignore", over="ignore"):
        found: list[float] = []
        if d.static:
            own = boxes[[p.shape for p in d.static]]
            lo, hi = transformed_boxes(np.array([p.matrix for p in d.static]), own[:, 0], own[:, 1])
            found += np.maximum(np.abs(lo - origin), np.abs(hi - origin)).max(axis=1).tolist()
        found += [_reach(placed_box(p.levels, prototype_boxes[p.prototype]), origin) for p in d.placements]
        reach = float(np.fmax.reduce(found, initial=0.0))
        if not np.isfinite(reach):
            return 0.0
        usual = [*found[: len(d.static)], *(_usual_distance(p, origin) for p in d.placements)]
        return min(reach, OUTLYING * min((r for r in usual if r > 0), default=reach))


def _reach(box: Box, origin: npt.NDArray[np.float64]) -> float:
    return float(np.fmax(np.abs(box[0] - origin).max(), np.abs(box[1] - origin).max()))


def _usual_distance(placement: Placement, origin: npt.NDArray[np.float64]) -> float:
    """The lower median of its instances, or of a part of many."""
    for rows in chunks(placement.levels, 1024):
        return float(np.quantile(np.abs(rows[:, :, 3] - origin).max(axis=1), 0.5, method="lower"))
    return 0.0


def power_of_two_scale(reach: float) -> float:
    """The power of two that brings `reach` into (0.5, 1]; 1 where it is 0."""
    return 1.0 if not reach > 0 else float(2.0 ** -np.ceil(np.log2(reach)))
