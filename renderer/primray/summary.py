"""What would be rendered, counted: for `primray inspect` and the report. Knows only the description, not USD."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from .description import Mesh, Placement, SceneDescription, Shape

# Estimates. Embree 4's BVH8 over triangles: measured 90 to 120 bytes a triangle with the robust flag.
BVH_BYTES_PER_TRIANGLE = 100
INSTANCE_BYTES = 168  # Embree's INSTANCE_ARRAY, from 10 million instances in 1.2 GB, and the core's matrix


@dataclass(frozen=True)
class LightSummary:
    path: str
    type: str
    emission: tuple[float, float, float]


@dataclass(frozen=True)
class Summary:
    camera: str  # "" for the automatic one
    resolution: tuple[int, int]
    lights: tuple[LightSummary, ...]
    surfaces: int
    meshes: int
    spheres: int
    triangles_unique: int  # stored
    triangles_instanced: int  # as seen, each instance counted
    spheres_instanced: int
    prototypes: int
    instances: int
    memory_bytes: int  # estimate: geometry, its acceleration structure and instances; textures and image not counted

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def summary(description: SceneDescription) -> Summary:
    """Counts of a description."""
    shapes = description.shapes
    count = [len(s.triangles) if isinstance(s, Mesh) else 0 for s in shapes]
    seen = [0] * len(shapes)
    for placed in description.static:
        seen[placed.shape] += 1
    _count_instances(description, description.placements, 1, seen)
    is_mesh = [isinstance(s, Mesh) for s in shapes]
    instances, stored, arrays = _instances(description)
    triangles = sum(count)
    return Summary(
        camera=description.camera.path,
        resolution=description.resolution,
        lights=tuple(LightSummary(light.path, light.type.value, light.emission) for light in description.lights),
        surfaces=len(description.surfaces),
        meshes=sum(is_mesh),
        spheres=len(shapes) - sum(is_mesh),
        triangles_unique=triangles,
        triangles_instanced=sum(n * k for n, k in zip(count, seen, strict=True)),
        spheres_instanced=sum(k for k, mesh in zip(seen, is_mesh, strict=True) if not mesh),
        prototypes=len(description.prototypes),
        instances=instances,
        memory_bytes=_array_bytes(shapes) + triangles * BVH_BYTES_PER_TRIANGLE + stored * INSTANCE_BYTES + arrays,
    )


def _count_instances(d: SceneDescription, placements: tuple[Placement, ...], times: int, seen: list[int]) -> None:
    """Add to `seen`, by shape, how often it stands in the world."""
    for placement in placements:
        count, prototype = times * len(placement), d.prototypes[placement.prototype]
        for placed in prototype.shapes:
            seen[placed.shape] += count
        _count_instances(d, prototype.placements, count, seen)


def _instances(d: SceneDescription) -> tuple[int, int, int]:
    """Instances in the world, those stored (fewer where nested ones are kept in two levels), and the description's bytes."""
    inner = [p for prototype in d.prototypes for p in prototype.placements]
    inside = [sum(map(len, p.placements)) or 1 for p in d.prototypes]
    whole = sum(len(p) * inside[p.prototype] for p in d.placements)
    every = [*d.placements, *inner]
    return whole, sum(map(len, every)), sum(p.nbytes for p in every)


def counts(summed: Summary) -> dict[str, int]:
    """The numbers of a Summary."""
    return {name: value for name, value in asdict(summed).items() if isinstance(value, int)}


def _array_bytes(shapes: tuple[Shape, ...]) -> int:
    """Of all arrays that meshes hold, shared ones once."""
    arrays = {}
    for shape in shapes:
        if isinstance(shape, Mesh):
            for values in (shape.points, shape.triangles, shape.normals, shape.colors):
                if values is not None:
                    arrays[id(values)] = values.nbytes
    return sum(arrays.values())
