"""Hands a SceneDescription to the core's builder: chooses origin and scale, merges what is static, counts what is left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .description import (
    Camera,
    LightType,
    Mesh,
    Placed,
    Placement,
    Projection,
    SceneDescription,
    Shape,
    Sphere,
    SubdivisionMesh,
)
from .placement import Box, placed_box, transformed_box

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
    textures: Mapping[str, npt.NDArray[np.float32]],
    filter_width: float,
    filter_inverse_cdf: npt.NDArray[np.float32],
) -> tuple[Any, list[tuple[str, str, str]]]:
    """The core's Scene, and (code, prim path, message) of what could not be taken along."""
    d = description
    boxes = [shape_box(s) for s in d.shapes]
    prototype_boxes = boxes_of_prototypes(d, boxes)
    origin = d.camera.world_from_camera[:3, 3]
    builder = core.SceneBuilder(origin, power_of_two_scale(scene_reach(d, boxes, prototype_boxes, origin)))
    for surface in d.surfaces:
        builder.add_surface(surface)
    add_shapes(builder, d.shapes, d.static)
    warnings: list[tuple[str, str, str]] = []
    builder.reserve_instances(sum(map(len, [*d.placements, *(p for proto in d.prototypes for p in proto.placements)])))
    numbers: dict[int, int] = {}
    # Prototypes of placements last: what they place has its number by then.
    for i, proto in sorted(enumerate(d.prototypes), key=lambda item: bool(item[1].placements)):
        low, high = prototype_boxes[i]
        numbers[i] = builder.begin_prototype((low + high) / 2, power_of_two_scale(float(np.max(high - low)) / 2))
        add_shapes(builder, d.shapes, proto.shapes)
        add_placements(builder, d, proto.placements, numbers[i], numbers, warnings)
    add_placements(builder, d, d.placements, 0, numbers, warnings)
    for light in d.lights:
        texture = NO_TEXTURE if light.texture is None else textures.get(light.texture.path, NO_TEXTURE)
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
            np.ascontiguousarray(texture, np.float32),
        )
    set_camera(builder, d.camera, d.resolution, filter_width, filter_inverse_cdf)
    return builder.finish(), warnings


def add_placements(
    builder: Any,
    d: SceneDescription,
    placements: Sequence[Placement],
    parent: int,
    numbers: Mapping[int, int],
    warnings: list[tuple[str, str, str]],
) -> None:
    """Into the group `parent`, 0 being the world."""
    for placement in placements:
        builder.begin_placement(parent, numbers[placement.prototype])
        left_out = sum(builder.add_instances(rows) for rows in placement.chunks())
        builder.end_placement()
        if left_out:
            path = d.prototypes[placement.prototype].path
            warnings.append(
                ("singular-transform", path, f"{left_out} instances have a singular or non-finite matrix and are left out")
            )


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


def matrix(m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.ascontiguousarray(m, np.float64)


def add_shapes(builder: Any, shapes: Sequence[Shape], placed: Sequence[Placed]) -> None:
    for p in placed:
        shape = shapes[p.shape]
        if isinstance(shape, Mesh):
            add_mesh(builder, shape, matrix(p.matrix))
        elif isinstance(shape, Sphere):
            builder.add_sphere(shape.radius, shape.surface, matrix(p.matrix))
        else:
            raise ValueError(f"{shape.path} is not diced")


def add_mesh(builder: Any, mesh: Mesh, world_from_object: npt.NDArray[np.float64]) -> None:
    points, triangles = len(mesh.points), len(mesh.triangles)
    surfaces = np.atleast_1d(np.asarray(mesh.surface, np.int32))
    builder.add_mesh(
        mesh.points,
        mesh.triangles,
        NO_FLOATS if mesh.normals is None else mesh.normals,
        kind(mesh.normals, points, triangles, normals=True),
        NO_FLOATS if mesh.colors is None else mesh.colors,
        kind(mesh.colors, points, triangles, normals=False),
        surfaces,
        world_from_object,
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


def shape_box(shape: Shape) -> Box:
    if isinstance(shape, Mesh | SubdivisionMesh):
        if len(shape.points) == 0:
            return np.zeros(3), np.zeros(3)
        return shape.points.min(axis=0).astype(np.float64), shape.points.max(axis=0).astype(np.float64)
    r = np.full(3, abs(shape.radius))
    return -r, r


def union(boxes: Sequence[Box]) -> Box:
    if not boxes:
        return np.zeros(3), np.zeros(3)
    return np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)


def boxes_of_prototypes(d: SceneDescription, boxes: list[Box]) -> list[Box]:
    """Each in its own space."""
    leaves = [union([transformed_box(p.matrix, boxes[p.shape]) for p in proto.shapes]) for proto in d.prototypes]
    return [
        union([placed_box(p.levels, leaves[p.prototype]) for p in proto.placements]) if proto.placements else leaf
        for proto, leaf in zip(d.prototypes, leaves, strict=True)
    ]


def scene_reach(d: SceneDescription, boxes: list[Box], prototype_boxes: list[Box], origin: npt.NDArray[np.float64]) -> float:
    """Largest coordinate distance of any geometry from the origin; 0 for an empty scene."""
    reach = 0.0
    with np.errstate(invalid="ignore", over="ignore"):
        for p in d.static:
            lo, hi = transformed_box(p.matrix, boxes[p.shape])
            reach = np.fmax(reach, np.fmax(np.abs(lo - origin).max(), np.abs(hi - origin).max()))
        for placement in d.placements:
            lo, hi = placed_box(placement.levels, prototype_boxes[placement.prototype])
            reach = np.fmax(reach, np.fmax(np.abs(lo - origin).max(), np.abs(hi - origin).max()))
    return float(reach) if np.isfinite(reach) else 0.0


def power_of_two_scale(reach: float) -> float:
    """The power of two that brings `reach` into (0.5, 1]; 1 where it is 0."""
    return 1.0 if not reach > 0 else float(2.0 ** -np.ceil(np.log2(reach)))
