"""Counts and memory estimates of what would be rendered, for `primray inspect` and the report: geometry, textures, motion.

This module knows only the description, not USD.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from .. import core
from ..arrays import Doubles
from ..core.overlapping_curves import copied_segments
from ..description import (
    Curves,
    DisplacedMesh,
    Mesh,
    MotionSteps,
    NurbsPatch,
    Placement,
    SceneDescription,
    Shape,
    Sphere,
    SubdivisionMesh,
    TextureInput,
    VolumeEmission,
    VolumeMedium,
)
from ..description.placement import transformed_box
from ..description.shading import pattern_files
from ..errors import AssetError
from ..settings import DEFAULT_DICING_RATE
from ..tessellation.dice import estimated_triangles
from ..tessellation.footprint import Footprint, footprints
from ..textures.image_layout import read_header

if TYPE_CHECKING:
    from ..volumes.volume_grid import VolumeGrid

# Peak bytes, fitted to measurements by `python -m tests.bench.setup.memory`. Arrays of the description are counted exactly,
# twice because the core copies them; the constants below come on top.
TRIANGLE_BYTES = 120  # Embree's hierarchy and the scratch memory of its build
DISPLACED_TRIANGLE_BYTES = 60  # half a vertex with displacement, original position and normals, the last in double precision
DICED_TRIANGLE_BYTES = 70  # half a vertex with its normal and three indices, twice, plus dicing
DICED_MOMENT_BYTES = 24  # half a vertex with its normal, twice, for each further motion sample of a cage
SHAPE_BYTES = 2000
SEGMENT_BYTES = 215  # a curve segment in the core and in Embree, with end caps
INSTANCE_BYTES = 210  # Embree's INSTANCE_ARRAY and the core's matrix; arrays of the description are counted separately
PIXEL_BYTES = 146  # exact sums and counts of both replicates, and the image with its errors
# Images stay in their stored type until the core has made its mip levels (as fine as the view needs: about four texels a
# pixel, plus a third for the coarser levels, two bytes a channel). One image at a time is expanded to floats, with its first
# coarser levels, or converted between colour spaces.
KEPT_TEXEL_BYTES = 2 * 4 / 3
TEXELS_PER_PIXEL = 4
IMAGE_BYTES = {1: 5.3, 2: 5.3, 4: 7.5}  # per channel value, by its stored size; half floats are read before they are widened
PROCESS_BYTES = 150 * 2**20  # Python, USD, OpenImageIO and the core, without a scene
VIEW_BYTES = 48 * 2**20  # OpenColorIO when a PNG is written, when most of the scene's peak is free again


@dataclass(frozen=True)
class ImageSize:
    """Size of a decoded texture image, before the core converts it."""

    width: int
    height: int
    channels: int
    channel_bytes: int  # 1, 2 or 4

    @property
    def values(self) -> int:
        return self.width * self.height * self.channels


@dataclass(frozen=True)
class LightSummary:
    """A light as `primray inspect` lists it."""

    path: str
    type: str
    emission: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Counts of a scene, and its estimated memory."""

    camera: str  # "" for the automatic camera
    resolution: tuple[int, int]
    lights: tuple[LightSummary, ...]
    surfaces: int
    meshes: int
    cages: int  # subdivision surfaces, whose triangles are estimated
    spheres: int
    triangles_unique: int  # stored
    triangles_instanced: int  # counted once for each instance
    spheres_instanced: int
    prototypes: int
    instances: int
    textures: int  # files
    memory_bytes: int  # estimate of the peak: geometry, hierarchies, instances, textures, film
    process_bytes: int  # estimate of the whole process's peak
    memory_parts: dict[str, int]  # `memory_bytes` by purpose

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def summary(
    description: SceneDescription, dicing_rate: float = DEFAULT_DICING_RATE, images: Sequence[ImageSize] = ()
) -> Summary:
    """Return counts of a description with these textures, its cages diced to edges of `dicing_rate` pixels."""
    shapes = description.shapes
    prints = footprints(description) | footprints(description, NurbsPatch)
    count = [_triangles(s, prints.get(k), dicing_rate) for k, s in enumerate(shapes)]
    seen = [0] * len(shapes)
    for placed in description.static:
        seen[placed.shape] += 1
    _count_instances(description, description.placements, 1, seen)
    is_sphere = [isinstance(s, Sphere) for s in shapes]
    is_cage = [isinstance(s, SubdivisionMesh | NurbsPatch) for s in shapes]
    instances, stored, placement_bytes = _instances(description)
    width, height = description.frame.size
    loading, kept = _image_bytes(images, width * height)
    hierarchies = sum(count) * TRIANGLE_BYTES
    parts = {
        "geometry": 2 * _array_bytes(shapes)
        + sum(n * _diced_bytes(s) for n, s in zip(count, shapes, strict=True) if isinstance(s, SubdivisionMesh | NurbsPatch))
        + (sum(int(s.segments.sum()) for s in shapes if isinstance(s, Curves)) + copied_segments(description)) * SEGMENT_BYTES
        + len(shapes) * SHAPE_BYTES,
        "acceleration structures": hierarchies,
        "textures": kept + max(loading - hierarchies, 0),  # hierarchies are built when the images are gone
        "instances": stored * INSTANCE_BYTES + placement_bytes,
        "film": width * height * PIXEL_BYTES,
    }
    if description.volumes:
        parts["volumes"] = _grid_bytes(description)
    memory = sum(parts.values())
    return Summary(
        camera=description.camera.path,
        resolution=description.resolution,
        lights=tuple(LightSummary(light.path, light.type.value, light.emission) for light in description.lights),
        surfaces=len(description.surfaces),
        meshes=sum(isinstance(s, Mesh) for s in shapes),
        cages=sum(is_cage),
        spheres=sum(is_sphere),
        triangles_unique=sum(count),
        triangles_instanced=sum(n * k for n, k in zip(count, seen, strict=True)),
        spheres_instanced=sum(k for k, sphere in zip(seen, is_sphere, strict=True) if sphere),
        prototypes=len(description.prototypes),
        instances=instances,
        textures=len(texture_files(description)),
        memory_bytes=memory,
        process_bytes=PROCESS_BYTES + max(memory, VIEW_BYTES),
        memory_parts=parts,
    )


def volume_facts(description: SceneDescription) -> list[dict[str, Any]]:
    """Return the volumes in grids by path: their grids with active voxels, extent in voxels and bytes, their instances, and the
    box around the active voxels of all of these in the world.

    Grids with the extinction, the albedo and the emission of a volume are listed once each.
    """
    found: dict[str, dict[str, Any]] = {}
    for volume in description.volumes:
        own = found.setdefault(volume.path, {"path": volume.path, "instances": 0, "box": None, "grids": {}})
        own["instances"] = max(own["instances"], len(volume.matrices))
        own["box"] = _joined(own["box"], _active_box(volume))
        for grid in (volume.grid, getattr(volume, "albedo_grid", None)):
            if grid is not None:
                own["grids"][id(grid)] = _grid_facts(grid, volume.matrices)
    return [{**own, "grids": list(own["grids"].values())} for own in found.values()]


def _grid_facts(grid: VolumeGrid, matrices: Doubles) -> dict[str, Any]:
    """Return facts of a grid; `matrices`: world_from_index (N, 4, 4), of which the first gives the size of its voxels."""
    size = None if grid.bounds is None else [int(n) for n in grid.bounds[1] - grid.bounds[0] + 1]
    voxel = [float(np.linalg.norm(column)) for column in matrices[0, :3, :3].T] if len(matrices) else None
    return {
        "name": grid.name,
        "voxels": int(grid.active_voxels),
        "size": size,
        "voxel_size": voxel,
        "bytes": int(grid.nbytes),
    }


WorldBox = list[list[float]]  # low and high corner


def _active_box(volume: VolumeMedium | VolumeEmission) -> WorldBox | None:
    """Return the box in the world around the active voxels of all instances at the frame; None where there are none."""
    if volume.grid.bounds is None or not len(volume.matrices):
        return None
    first, last = volume.grid.bounds.astype(np.float64)
    low, high = transformed_box(volume.matrices, (first - 0.5, last + 0.5))
    return [low.min(axis=0).tolist(), high.max(axis=0).tolist()]


def _joined(a: WorldBox | None, b: WorldBox | None) -> WorldBox | None:
    if a is None or b is None:
        return a or b
    return [np.minimum(a[0], b[0]).tolist(), np.maximum(a[1], b[1]).tolist()]


def _grid_bytes(description: SceneDescription) -> int:
    """Return the bytes of the grids of volumes, of which the core has copies."""
    grids = {id(volume.grid): volume.grid for volume in description.volumes}
    grids |= {id(medium.albedo_grid): medium.albedo_grid for medium in description.media if medium.albedo_grid is not None}
    grids |= {id(v.blur.velocity): v.blur.velocity for v in description.volumes if v.blur is not None}
    return 2 * sum(grid.nbytes for grid in grids.values())


def _image_bytes(images: Sequence[ImageSize], pixels: int) -> tuple[int, int]:
    """Return the peak bytes while images are loaded and uploaded, and the bytes that the core keeps of them."""
    loading: float = sum(i.values * i.channel_bytes for i in images)
    loading += max((i.values * IMAGE_BYTES[i.channel_bytes] for i in images), default=0.0)
    kept = sum(min(i.width * i.height, TEXELS_PER_PIXEL * pixels) * i.channels for i in images) * KEPT_TEXEL_BYTES
    return int(loading), int(kept)


def _count_instances(d: SceneDescription, placements: tuple[Placement, ...], times: int, seen: list[int]) -> None:
    """Add to `seen`, by shape, how often it occurs in the world."""
    for placement in placements:
        count, prototype = times * len(placement), d.prototypes[placement.prototype]
        for placed in prototype.shapes:
            seen[placed.shape] += count
        _count_instances(d, prototype.placements, count, seen)


def _instances(d: SceneDescription) -> tuple[int, int, int]:
    """Return the numbers of instances in the world and of those stored, and the bytes of their arrays.

    Fewer are stored than seen where nested instances are kept in two levels.
    """
    inner = [p for prototype in d.prototypes for p in prototype.placements]
    inside = [sum(map(len, p.placements)) or 1 for p in d.prototypes]
    whole = sum(len(p) * inside[p.prototype] for p in d.placements)
    every = [*d.placements, *inner]
    return whole, sum(map(len, every)), sum(p.nbytes for p in every)


def texture_files(description: SceneDescription) -> dict[str, None]:
    """Return the paths of all textures, UDIM tiles separately, in order of use."""
    files = [light.texture for light in description.lights if light.texture is not None]
    for surface in description.surfaces:
        files += [made.file for _, made in surface.inputs if isinstance(made, TextureInput)]
        files += pattern_files(surface.pattern) if surface.pattern else ()
    return dict.fromkeys(path for file in files for path in ([tile for _, tile in file.tiles] or [file.path]) if path)


def primvar_names(description: SceneDescription) -> dict[str, int]:
    """Return, for each primvar that surfaces can read, the number of shapes that have it."""
    return dict(Counter(primvar.name for shape in description.shapes for primvar in shape.primvars))


def counts(summed: Summary) -> dict[str, int]:
    """Return the integer fields of a Summary."""
    return {name: value for name, value in asdict(summed).items() if isinstance(value, int)}


def _triangles(shape: Shape, footprint: Footprint | None, dicing_rate: float) -> int:
    if isinstance(shape, SubdivisionMesh | NurbsPatch) and footprint is not None:
        return estimated_triangles(core.compiled, shape, footprint, dicing_rate)
    return len(shape.triangles) if isinstance(shape, Mesh) else 0


def _diced_bytes(cage: SubdivisionMesh | NurbsPatch) -> int:
    """Return the bytes of a diced triangle of this cage."""
    moved = DISPLACED_TRIANGLE_BYTES if isinstance(cage, DisplacedMesh) else 0
    return moved + DICED_TRIANGLE_BYTES + (0 if cage.motion is None else len(cage.motion.times) * DICED_MOMENT_BYTES)


def _array_bytes(shapes: tuple[Shape, ...]) -> int:
    """Return the bytes of all arrays of the shapes, shared ones counted once."""
    arrays: dict[int, int] = {}
    for shape in shapes:
        held = [getattr(shape, name) for name in _ARRAYS[type(shape)]]
        if not isinstance(shape, Sphere) and shape.motion is not None:
            held += [shape.motion.points, shape.motion.normals]
        for values in held + [p.values for p in shape.primvars]:
            if isinstance(values, np.ndarray):
                arrays[id(values)] = values.nbytes
    return sum(arrays.values())


# Fields that are or may be arrays, by shape type.
_ARRAYS = {
    kind: [field.name for field in fields(kind) if "Floats" in str(field.type) or "Ints" in str(field.type)]
    for kind in get_args(Shape)
}


def motion_facts(description: SceneDescription) -> dict[str, Any] | None:
    """Return the shutter and, by kind, how many things move and which has the most segments; None if nothing moves.

    Shutter times are time codes relative to the frame.
    """
    exposure = description.exposure
    if exposure is None:
        return None
    kinds = dict.fromkeys(steps.kind for steps in description.motion_steps)
    of_kind = {kind: [steps for steps in description.motion_steps if steps.kind == kind] for kind in kinds}
    return {
        "shutter": [exposure.opens, exposure.closes],
        "span": list(exposure.span),
        "moving": {kind: _most(found) for kind, found in of_kind.items()},
    }


def _most(found: list[MotionSteps]) -> dict[str, Any]:
    finest = max(found, key=lambda steps: steps.segments)
    return {
        "count": len(found),
        "segments": finest.segments,
        "why": "error" if finest.by_error else "samples",
        "path": finest.path,
        "error_pixels": max(steps.error for steps in found),
    }


def texture_sizes(description: SceneDescription, read: Callable[[str], bytes]) -> dict[str, ImageSize | None]:
    """Return the image size by path; None for unreadable files. `read` is as in read_header."""
    return {path: _size(path, read) for path in texture_files(description)}


def _size(path: str, read: Callable[[str], bytes]) -> ImageSize | None:
    import OpenImageIO as oiio

    try:
        header = read_header(path, read)
    except AssetError:
        return None
    if header is None:
        return None
    kept = {oiio.UINT8: 1, oiio.UINT16: 2}.get(header.format.basetype, 4)
    return ImageSize(header.width, header.height, header.nchannels, kept)
