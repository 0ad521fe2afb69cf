"""Upload of a SceneDescription to the core's scene builder: origin and scale, static shapes, placements, lights, camera."""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..aovs import WIDE, primvars_of
from ..arrays import Doubles
from ..description import (
    Camera,
    CameraMotion,
    Fog,
    Frame,
    Mesh,
    MovingInstances,
    Placed,
    Placement,
    Projection,
    SceneDescription,
    Shape,
    Sphere,
    SubdivisionMesh,
)
from ..description.motion import handed_over
from ..description.placement import (
    CHUNK,
    IDENTITY,
    Box,
    PointInstances,
    chunks,
    named_levels,
    placed_box,
    transformed_box,
    transformed_boxes,
)
from ..description.volumes import volume_boxes
from ..lens.distortion import Distortion
from ..time_spans import span
from . import compiled
from .dome_look import DomeLook
from .inputs import filled, phase_number
from .light_upload import LightGroups, LightUpload
from .motion_times import with_common_times
from .overlapping_curves import with_curves_in_world
from .scene_record import SceneRecord, ShapeRows
from .shape_upload import NO_FLOATS, ShapeUpload, matrix
from .single_precision import (
    FARTHEST,
    OUTLYING,
    FarInstances,
    boxes_without_outliers,
    rebasing_origin,
    separate_skewed,
    separate_stretched_curves,
    union_without_outliers,
)
from .surface_upload import KeptImages, MutableTextures, OnFile, SurfaceUpload, TextureKey
from .surface_upload import width as width_of
from .tiled_textures import TiledTextures


def upload_scene(
    description: SceneDescription,
    textures: MutableTextures,
    filter_width: float,
    filter_inverse_cdf: npt.NDArray[np.float32],
    shapes: list[Shape] | None = None,
    record: SceneRecord | None = None,
    kept: KeptImages | None = None,
    on_file: OnFile | None = None,
    tiled: TiledTextures | None = None,
) -> tuple[compiled.Scene, UploadRecord]:
    """Upload a description; return the core's Scene and a record of the upload. Empties `textures` to save memory.

    `shapes`, if given, replaces the description's shapes; it is emptied once the core has copies, before acceleration
    structures are built. `record` receives the meaning of the core's row numbers. `on_file` and `tiled`: as in
    SurfaceUpload.add_images.
    """
    shapes = list(description.shapes) if shapes is None else shapes
    warnings: list[tuple[str, str, str]] = []
    d, copies = with_curves_in_world(separate_stretched_curves(description, shapes), shapes)
    d = separate_skewed(with_common_times(d, shapes, warnings), shapes)
    full_boxes = shape_boxes(shapes)
    boxes = boxes_without_outliers(full_boxes, shapes)
    prototype_boxes = boxes_of_prototypes(d, boxes)
    origin = rebasing_origin(d.anchor or d.camera)
    low, high = world_boxes(d, boxes, prototype_boxes)
    scale = power_of_two_scale(scene_extent(d, low, high, origin))
    builder = compiled.SceneBuilder(origin.tolist(), scale)
    if kept is not None:
        builder.keep_domes(kept.textures)
    inputs = SurfaceUpload(builder, textures, d.time_code or 0.0)
    lights = LightUpload(builder, () if kept is None else kept.domes, d.lights_apart)
    if record is not None:
        record_names(record, description, shapes, inputs)
    builder.reserve_triangles(*points_and_triangles(shapes))
    if d.linked.collections:
        builder.set_links(d.linked.members.astype(np.uint8))
    headers = {file: [(number, tile.without_texels()) for number, tile in tiles] for file, tiles in textures.items()}
    surfaces = inputs.add_surfaces(d.surfaces)
    warnings.extend(inputs.warnings)
    inputs.warnings.clear()
    handing = ShapeUpload(builder, inputs, lights, surfaces, shapes, full_boxes, warnings, record)
    with span("hand over shapes"):
        handing.add(d.static, origin, scale)
    rows = handing.rows_of_last()
    instances = sum(map(len, [*d.placements, *(p for proto in d.prototypes for p in proto.placements)]))
    builder.reserve_instances(instances)
    numbers: dict[int, int] = {}
    placements = PlacementUpload(
        builder=builder,
        inputs=inputs,
        description=d,
        numbers=numbers,
        prototype_boxes=prototype_boxes,
        warnings=warnings,
        record=record,
    )
    with span("hand over instances"):
        # Prototypes that contain placements come last: the prototypes they place have their numbers by then.
        for i, proto in sorted(enumerate(d.prototypes), key=lambda item: bool(item[1].placements)):
            corner, opposite = prototype_boxes[i]
            center, unit = (corner + opposite) / 2, power_of_two_scale(float(np.max(opposite - corner)) / 2)
            numbers[i] = builder.begin_prototype(center.tolist(), unit)
            handing.add(proto.shapes, center, unit)
            placements.add(proto.placements, numbers[i], center, unit)
        placements.add(d.placements, 0, origin, scale)
    with span("hand over lights"):
        lights.add(d.lights, textures)
    if d.volumes:  # imported here, since most scenes have none
        from .volume_upload import VolumeUpload

        VolumeUpload(builder, warnings).add(d.media, d.volume_emissions)
        if record is not None:
            record.media = [(medium.path, medium.material) for medium in d.media]
    if d.fog is not None:
        builder.set_fog(fog_input(d.fog))
    if d.exposure is not None:
        builder.set_exposure(*d.exposure.shutter, d.exposure.frame)
        builder.set_rolling_shutter(*d.exposure.rolling)
    camera = camera_input(d.camera, d.frame, d.camera_motion)
    builder.set_camera(filled(camera, filter_width=filter_width, filter_inverse_cdf=filter_inverse_cdf))
    with span("hand over images"):
        inputs.add_images(kept, on_file, tiled)
    warnings.extend(inputs.warnings)
    items = sum(points_and_triangles(shapes)) + instances
    shapes.clear()
    if items > WORTH_ITEMS:
        give_back()
    with span("finish the scene"):
        scene = builder.finish()
    is_editable = d.exposure is None and boxes is full_boxes and not lights.has_mesh_lights
    return scene, UploadRecord(
        description=d,
        warnings=warnings,
        origin=origin,
        scale=scale,
        boxes=boxes,
        prototype_boxes=prototype_boxes,
        low=low,
        high=high,
        rows=rows,
        textures=headers,
        texture_numbers=inputs.texture_numbers,
        light_groups=lights.groups,
        is_editable=is_editable,
        shape_rows=handing.shape_rows,
        light_paths=lights.paths,
        dome_paths=lights.dome_paths,
        domes=tuple(lights.domes),
        copies=copies,
    )


def upload(
    description: SceneDescription,
    textures: MutableTextures,
    filter_width: float,
    filter_inverse_cdf: npt.NDArray[np.float32],
    shapes: list[Shape] | None = None,
    record: SceneRecord | None = None,
) -> tuple[compiled.Scene, list[tuple[str, str, str]], Box | None]:
    """Return the core's Scene, all warnings, and the box of everything placed in the world, or None; see `hand_over`."""
    scene, found = upload_scene(description, textures, filter_width, filter_inverse_cdf, shapes, record)
    return scene, [*found.warnings, *emitter_warnings(scene)], found.bounds


@dataclass(frozen=True, kw_only=True)
class UploadRecord:
    """A record of what was uploaded and how, for replacing parts of it later."""

    description: SceneDescription  # without matrices that are singular in single precision
    warnings: list[tuple[str, str, str]]  # code, prim path, message
    origin: Doubles  # (3,)
    scale: float
    boxes: Doubles  # (S, 2, 3), of shapes
    prototype_boxes: list[Box]
    low: Doubles  # (N, 3), of everything placed in the world, shapes first
    high: Doubles
    rows: list[int]  # the core's first row of each static shape; -1 unless it is one plain mesh
    textures: MutableTextures  # headers of the textures that could be read, without texels
    texture_numbers: dict[TextureKey, int]  # the core's
    light_groups: LightGroups
    is_editable: bool  # the scene can be edited: no exposure, no shape is a light or an outlier
    shape_rows: ShapeRows
    light_paths: dict[int, str]  # by the core's row, of lights that are prims of their own
    dome_paths: list[str]  # in the core's order
    domes: tuple[DomeLook, ...]  # the same
    copies: tuple[Placed, ...]  # of instances of curves that overlap: the last of the description's static shapes

    @property
    def bounds(self) -> Box | None:
        """Box around everything placed in the world."""
        return (self.low.min(axis=0), self.high.max(axis=0)) if len(self.low) else None


def emitter_warnings(scene: compiled.Scene) -> list[tuple[str, str, str]]:
    """Return a warning if some emissive instances are not sampled as lights."""
    if not scene.unsampled_emitters:
        return []
    message = f"{scene.unsampled_emitters} emissive instances are too many to be sampled as lights: expect noise"
    return [("emitters-unsampled", "", message)]


@dataclass(frozen=True, kw_only=True)
class PlacementUpload:
    """Uploads placements with their instances' primvars; instances that are left out are reported in `warnings`."""

    builder: compiled.SceneBuilder
    inputs: SurfaceUpload
    description: SceneDescription
    numbers: Mapping[int, int]  # the core's group numbers, by prototype
    prototype_boxes: Sequence[Box]
    warnings: list[tuple[str, str, str]]
    record: SceneRecord | None = None

    def add(self, placements: Sequence[Placement], parent: int, center: Doubles, scale: float) -> None:
        """Add placements to the group `parent`; 0: the world."""
        for placement in placements:
            path = self.description.prototypes[placement.prototype].path
            box = self.prototype_boxes[placement.prototype]
            with np.errstate(over="ignore", invalid="ignore"):
                reach = _extent(placed_box(placement.levels, box), center) * scale
            far = None if reach < FARTHEST else FarInstances(box, center, FARTHEST / scale)
            left_out = add_placement(self.builder, placement, parent, self.numbers[placement.prototype], far)
            if self.record is not None and self.builder.placement_rows > len(self.record.placements):
                rows = np.delete(np.arange(len(placement)), left_out) if len(left_out) else None
                self.record.placements.append((named_levels(placement.levels), rows))
            for name, _, width, values in self.inputs.primvars(placement.primvars):
                kept = np.delete(values, left_out, axis=0) if len(left_out) else values
                self.builder.add_placement_primvar(name, width, kept)
            gone = far.count(placement) if far else 0
            if gone:
                self.warnings.append(("too-far", path, f"{gone} instances are too large or too far away to be drawn"))
            if len(left_out) > gone:
                message = f"{len(left_out) - gone} instances have a singular or non-finite matrix and are left out"
                self.warnings.append(("singular-transform", path, message))


def record_names(record: SceneRecord, d: SceneDescription, shapes: Sequence[Shape], inputs: SurfaceUpload) -> None:
    """Record the paths of shapes and surfaces, and the primvars that AOVs read."""
    record.shape_paths = [shape.path for shape in shapes]
    record.surface_paths = [surface.path for surface in d.surfaces]
    wanted = primvars_of(d.aovs)
    record.primvar_names = inputs.name_primvars([name for own in wanted for name in (own, WIDE + own)])
    for owner in (*shapes, *d.placements, *(p for proto in d.prototypes for p in proto.placements)):
        for primvar in owner.primvars:
            if primvar.name in record.primvar_names:
                record.note_primvar(primvar.name, width_of(primvar.values))


def add_placement(
    builder: compiled.SceneBuilder, placement: Placement, parent: int, prototype: int, far: FarInstances | None = None
) -> npt.NDArray[np.int64]:
    """Add a placement; return the indices of instances that are left out, for which the core has no row."""
    builder.begin_placement(parent, prototype)
    left_out, start = [np.zeros(0, np.int64)], 0
    if isinstance(moving := placement.levels[0], MovingInstances):
        rows = moving.matrices if far is None else np.stack([far.removed(step) for step in moving.matrices])
        gone = builder.add_moving_instances(handed_over(moving.times), moving.turns, np.ascontiguousarray(rows, np.float64))
        builder.end_placement()
        return gone
    if far is None and len(placement.levels) == 1 and isinstance(points := placement.levels[0], PointInstances):
        left_out += _add_points(builder, points)
        builder.end_placement()
        return np.concatenate(left_out)
    for rows in placement.chunks():
        left_out.append(builder.add_instances(rows if far is None else far.removed(rows)) + start)
        start += len(rows)
    builder.end_placement()
    return np.concatenate(left_out)


def _add_points(builder: compiled.SceneBuilder, points: PointInstances) -> list[npt.NDArray[np.int64]]:
    """Add point instances without making their matrices here; return the indices of those left out."""
    outer, left_out = None if np.array_equal(points.outer, IDENTITY) else matrix(points.outer), []
    for start in range(0, len(points), CHUNK):
        parts = [
            None if part is None else np.ascontiguousarray(part[start : start + CHUNK], np.float64)
            for part in (points.positions, points.orientations, points.scales)
        ]
        positions, orientations, scales = parts
        assert positions is not None
        left_out.append(builder.add_point_instances(outer, positions, orientations, scales) + start)
    return left_out


def camera_input(c: Camera, frame: Frame, motion: CameraMotion | None = None) -> compiled.CameraInput:
    """Return the input of a camera, without its pixel filter."""
    pixels = frame.pixels
    width, height = frame.resolution
    near, far = c.clipping_range
    made = filled(
        compiled.CameraInput(),
        world_from_camera=matrix(c.world_from_camera),
        orthographic=c.projection is Projection.ORTHOGRAPHIC,
        window=c.window,
        near=near,
        far=far,
        lens_radius=c.lens_radius,
        focus_distance=c.focus_distance,
        blades=c.blades,
        blade_rotation_deg=c.blade_rotation_deg,
        clipping_planes=np.array(c.clipping_planes, np.float64).ravel(),
        width=width,
        height=height,
        pixels=(pixels.x, pixels.y, pixels.width, pixels.height),
    )
    if c.distortion is not None and c.projection is Projection.PERSPECTIVE:
        made.distortion = distortion_input(c.distortion)
    filled(
        made,
        natural_vignetting=c.natural_vignetting,
        rim_distance=c.rim[0],
        rim_radius=c.rim[1],
        magnification=c.channel_magnification,
        focus_shift=c.channel_focus_shift,
    )
    if motion is None:
        return made
    poses = np.array([pose.world_from_camera[:3] for pose in motion.cameras], np.float64)
    numbers = [(*pose.window, *pose.clipping_range, pose.lens_radius, pose.focus_distance) for pose in motion.cameras]
    return filled(made, times=handed_over(motion.times), pose_matrices=poses, pose_numbers=np.array(numbers, np.float64))


def fog_input(fog: Fog) -> compiled.FogInput:
    return filled(
        compiled.FogInput(),
        density=fog.density,
        albedo=fog.albedo,
        emission=fog.emission,
        phase=phase_number(fog),
        top=[axis * (fog.top or 0.0) for axis in fog.up],
        up=(0.0, 0.0, 0.0) if fog.top is None else fog.up,
        falloff=fog.falloff,
        hidden=fog.hidden,
    )


def distortion_input(d: Distortion) -> compiled.DistortionInput:
    made = filled(
        compiled.DistortionInput(),
        model=d.model.value,
        coefficients=np.array(d.coefficients, np.float64),
        most_angle=np.radians(d.most_angle_deg),
    )
    if d.table is None:
        return made
    rows, columns, _ = d.table.directions.shape
    directions = np.ascontiguousarray(d.table.directions, np.float32).ravel()
    filled(made, table_window=d.table.window, table_rows=rows, table_columns=columns, directions=directions)
    if d.table.places is not None:
        made.places = np.ascontiguousarray(d.table.places, np.float32).ravel()
    return made


def shape_boxes(shapes: Sequence[Shape]) -> Doubles:
    """Return the boxes (S, 2, 3) of shapes: low and high corners, each in its own space."""
    boxes = compiled.boxes([getattr(s, "points", NO_FLOATS) for s in shapes])
    spheres = [(k, shape.radius) for k, shape in enumerate(shapes) if isinstance(shape, Sphere)]
    if spheres:  # vectorised, since there may be a million
        reach = np.abs([radius for _, radius in spheres])[:, None]
        boxes[[k for k, _ in spheres]] = np.stack([-reach, reach], axis=1)
    for k, shape in enumerate(shapes):
        if type(shape) not in (Mesh, SubdivisionMesh, Sphere):
            boxes[k] = shape.box()
    return boxes


def union(boxes: Sequence[Box]) -> Box:
    if not boxes:
        return np.zeros(3), np.zeros(3)
    return np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)


def points_and_triangles(shapes: Sequence[Shape]) -> tuple[int, int]:
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    return sum(len(mesh.points) for mesh in meshes), sum(len(mesh.triangles) for mesh in meshes)


def boxes_of_prototypes(d: SceneDescription, boxes: Doubles) -> list[Box]:
    """Return the box of each prototype in its own space."""
    leaves = [
        union_without_outliers(
            np.array([transformed_box(p.matrix, (boxes[p.shape, 0], boxes[p.shape, 1])) for p in proto.shapes])
        )
        for proto in d.prototypes
    ]
    return [
        union([placed_box(p.levels, leaves[p.prototype]) for p in proto.placements]) if proto.placements else leaf
        for proto, leaf in zip(d.prototypes, leaves, strict=True)
    ]


def world_boxes(d: SceneDescription, boxes: Doubles, prototype_boxes: list[Box]) -> Box:
    """Return low and high corners (N, 3) of the shapes, then the placements, then the volumes, in the world; one box for each
    placement and each volume."""
    found: list[Box] = [(np.zeros((0, 3)), np.zeros((0, 3)))]
    with np.errstate(invalid="ignore", over="ignore"):
        if d.static:
            own = boxes[[p.shape for p in d.static]]
            found.append(transformed_boxes(np.array([p.matrix for p in d.static]), own[:, 0], own[:, 1]))
        found += [
            (low[None], high[None]) for low, high in (placed_box(p.levels, prototype_boxes[p.prototype]) for p in d.placements)
        ]
        if len(volumes := volume_boxes(d.volumes)):
            found.append((volumes[:, 0], volumes[:, 1]))
    return np.concatenate([low for low, _ in found]), np.concatenate([high for _, high in found])


def scene_extent(d: SceneDescription, low: Doubles, high: Doubles, origin: npt.NDArray[np.float64]) -> float:
    """Return the largest coordinate distance of geometry from the origin, ignoring a few outliers; 0 for an empty scene.

    `low`, `high`: as `world_boxes` returns them.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        near, far = np.abs(low - origin), np.abs(high - origin)
        alone = np.maximum(near, far).max(axis=1)[: len(d.static)]
        placed = np.fmax(near.max(axis=1), far.max(axis=1))[len(d.static) :]
        found: list[float] = [*alone.tolist(), *placed.tolist()]
        reach = float(np.fmax.reduce(found, initial=0.0))
        if not np.isfinite(reach):
            return 0.0
        volumes = found[len(d.static) + len(d.placements) :]
        usual = [*found[: len(d.static)], *(_usual_distance(p, origin) for p in d.placements), *volumes]
        return min(reach, OUTLYING * min((r for r in usual if r > 0), default=reach))


def _extent(box: Box, origin: npt.NDArray[np.float64]) -> float:
    return float(np.fmax(np.abs(box[0] - origin).max(), np.abs(box[1] - origin).max()))


def _usual_distance(placement: Placement, origin: npt.NDArray[np.float64]) -> float:
    """Return the lower median of the instances' distances, from a sample of them where there are many."""
    for rows in chunks(placement.levels, 1024):
        return float(np.quantile(np.abs(rows[:, :, 3] - origin).max(axis=1), 0.5, method="lower"))
    return 0.0


def power_of_two_scale(reach: float) -> float:
    """Return the power of two that scales `reach` into (0.5, 1]; 1 where it is 0."""
    return 1.0 if not reach > 0 else float(2.0 ** -np.ceil(np.log2(reach)))


WORTH_ITEMS = 200_000  # triangles and instances; smaller scenes are not worth the time that reading the mappings takes
_DONTNEED = getattr(mmap, "MADV_DONTNEED", None)


def give_back() -> None:
    """Release free pages of the heap and clean pages of mapped files."""
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "malloc_trim") or _DONTNEED is None:
        return
    libc.malloc_trim(0)
    libc.madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    for start, size in _clean_file_pages():
        libc.madvise(start, size, _DONTNEED)


def _clean_file_pages() -> Iterator[tuple[int, int]]:
    """Return start and size of mapped files (libraries, USD files) that were never written to.

    Written pages ("Anonymous" in smaps) exist in no file.
    """
    try:
        with open("/proc/self/smaps", encoding="utf-8", errors="replace") as file:
            lines = file.readlines()
    except OSError:
        return
    start = size = 0
    for line in lines:
        if line.startswith("Anonymous:"):
            if size and line.split()[1] == "0":
                yield start, size
            size = 0
        elif not line[0].isupper():  # first line of a mapping: range, rights, offset, device, inode, name
            ends, rights, *rest = line.split(maxsplit=5)
            start, end = (int(end, 16) for end in ends.split("-"))
            is_file = len(rest) == 4 and rest[3].startswith("/") and rights in ("r--p", "r-xp")
            size = end - start if is_file else 0
