"""Boxes of things: on the film, and oriented in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..arrays import Doubles
from .layers import Numbers, PartNames, TaxonomyThings
from .things import Box3D

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..description import Camera
    from ..settings import RenderSettings
    from ..usd import LabelledPrims

MOST_PARTS = 50_000  # of a scene whose parts are all measured; of others, those of instances that rays hit
SHEAR = 1e-6  # cosine of the angle between axes that count as orthogonal


def parts_of_scene(scene: CoreScene, hit: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Return the parts (N, 3) of the scene: all of them, or of very many only those of instances that are in `hit` (M, 3)."""
    of_groups = core.parts_of_groups(scene)
    shapes = {int(group): of_groups[of_groups[:, 0] == group, 1] for group in np.unique(of_groups[:, 0])}
    numbers = scene.instance_numbers
    pairs = _instances(scene, shapes)
    if pairs is None:
        own = np.unique(hit[hit[:, 1] >= 0, 1:], axis=0) if len(hit) else np.zeros((0, 2), np.int32)
        groups = numbers.group[np.searchsorted(numbers.first, own[:, 0], side="right") - 1]
        pairs = np.column_stack([own, groups])
    found = [np.column_stack([shapes[0], np.full((len(shapes[0]), 2), -1)])] if 0 in shapes else []
    for instance, outer, group in pairs.tolist():
        own = shapes.get(group, np.zeros(0, np.int32))
        found.append(np.column_stack([own, np.full(len(own), instance), np.full(len(own), outer)]))
    return np.concatenate(found).astype(np.int32) if found else np.zeros((0, 3), np.int32)


def has_few_parts(scene: CoreScene) -> bool:
    """Return whether `parts_of_scene` returns all parts of the scene, whatever is hit."""
    of_groups = core.parts_of_groups(scene)
    shapes = {int(group): of_groups[of_groups[:, 0] == group, 1] for group in np.unique(of_groups[:, 0])}
    return _instances(scene, shapes) is not None


def _instances(scene: CoreScene, shapes: dict[int, npt.NDArray[np.int32]]) -> Numbers | None:
    """Return instance, outer instance and group (N, 3) of all instances; None if they have too many parts."""
    numbers = scene.instance_numbers
    found: list[Numbers] = []
    total = sum(len(own) for own in shapes.values())
    for placement in np.flatnonzero(numbers.parent == 0).tolist():
        group, first, count = int(numbers.group[placement]), int(numbers.first[placement]), int(numbers.counts[placement])
        rows = np.arange(first, first + count, dtype=np.int64)
        inside = [(group, -1, 1)]
        if group in numbers.inside:
            inner = [p for p in range(len(numbers.parent)) if int(numbers.parent[p]) == group]
            inside = [(int(numbers.group[p]), int(numbers.first[p]), int(numbers.counts[p])) for p in inner]
        for own, inner_first, inner_count in inside:
            total += count * inner_count * len(shapes.get(own, ()))
            if total > MOST_PARTS:
                return None
            if inner_first < 0:
                found.append(np.column_stack([rows, np.full(count, -1), np.full(count, own)]))
                continue
            inner_rows = np.arange(inner_first, inner_first + inner_count, dtype=np.int64)
            instance, outer = np.tile(inner_rows, count), np.repeat(rows, inner_count)
            found.append(np.column_stack([instance, outer, np.full(len(outer), own)]))
    return np.concatenate(found) if found else np.zeros((0, 3), np.int64)


@dataclass(frozen=True)
class Bounds:
    """Bounds of things, by place in their hierarchy; those of which there is nothing have infinite ones of the wrong sign."""

    film: Doubles  # (T, 4) pixels of the frame: left, top, right, bottom
    nearest: Doubles  # (T) depth, scene units
    corners: Doubles  # (T, 2, 3) in the axes of their boxes
    sheared: dict[int, Doubles]  # (2, 3) in the space of prims whose transform shears
    world_from_axes: Doubles  # (T, 4, 4), rigid
    world_from_prim: Doubles  # (T, 4, 4)
    is_cut: npt.NDArray[np.bool_]  # (T) whether the camera sees some of its points in no direction


def bounds_of(
    scene: CoreScene,
    parts: npt.NDArray[np.int32],
    names: PartNames,
    things: TaxonomyThings,
    labelled: LabelledPrims,
    settings: RenderSettings,
) -> Bounds:
    """Return the bounds of all things that the parts (N, 3) belong to."""
    numbers = names.number(parts)
    hierarchy = things.hierarchy
    place = things.places()[numbers] if len(numbers) else np.zeros(0, np.int64)
    prims = np.array([labelled.world_from(name) for name in hierarchy.names]).reshape(-1, 4, 4)
    rigid = np.array([_rigid(matrix) for matrix in prims]).reshape(-1, 4, 4)
    count = len(prims)
    with_shear = [n for n in range(count) if _is_sheared(prims[n])]
    axes = [*np.linalg.inv(rigid)[:, :3], *(np.linalg.inv(prims[n])[:3] for n in with_shear)]
    own_axes = {n: count + k for k, n in enumerate(with_shear)}
    parents = np.array(hierarchy.parents, np.int64)
    rows: list[npt.NDArray[Any]] = []
    at = np.arange(len(parts))
    while len(at := at[place >= 0]):
        place = place[place >= 0]
        rows.append(np.column_stack([parts[at], place]))
        rows += [np.column_stack([parts[at[place == n]], np.full((place == n).sum(), k)]) for n, k in own_axes.items()]
        place = parents[place]
    asked = np.concatenate(rows) if rows else np.zeros((0, 4), np.int32)
    found = core.extents(scene, asked, np.array(axes).reshape(-1, 3, 4), settings)
    film = np.tile([np.inf, np.inf, -np.inf, -np.inf], (len(axes), 1))
    corners = np.tile(np.array([[np.inf], [-np.inf]]), (len(axes), 1, 3))
    nearest = np.full(len(axes), np.inf)
    is_cut = np.zeros(len(axes), bool)
    is_cut[asked[found.unseen > 0, 3]] = True
    where = asked[:, 3]
    np.minimum.at(film[:, :2], where, found.film[:, :2])
    np.maximum.at(film[:, 2:], where, found.film[:, 2:])
    np.minimum.at(nearest, where, found.nearest)
    np.minimum.at(corners[:, 0], where, found.corners[:, 0])
    np.maximum.at(corners[:, 1], where, found.corners[:, 1])
    sheared = {n: corners[k] for n, k in own_axes.items()}
    return Bounds(film[:count], nearest[:count], corners[:count], sheared, rigid, prims, is_cut[:count])


def _rigid(matrix: Doubles) -> Doubles:
    """Return a rigid matrix with the origin of `matrix` and its axes, as far as these are orthogonal (Gram and Schmidt)."""
    found = np.eye(4)
    found[:3, 3] = matrix[:3, 3]
    x, y = matrix[:3, 0], matrix[:3, 1]
    length = np.linalg.norm(x)
    if length > 0:
        x = x / length
        y = y - x * (x @ y)
        if (height := np.linalg.norm(y)) > 1e-12 * np.linalg.norm(matrix[:3, 1]):
            y = y / height
            found[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
    return found


def _is_sheared(matrix: Doubles) -> bool:
    columns = matrix[:3, :3]
    lengths = np.linalg.norm(columns, axis=0)
    if not (lengths > 0).all() or abs(np.linalg.det(columns)) < 1e-12 * lengths.prod():
        return False
    cosines = (columns.T @ columns) / np.outer(lengths, lengths) - np.eye(3)
    return bool(np.abs(cosines).max() > SHEAR)


def box_3d(bounds: Bounds, place: int, camera: Camera, meters_per_unit: float) -> Box3D | None:
    """Return the oriented box of a thing; None where there is nothing of it."""
    low, high = bounds.corners[place]
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return None
    world_from_box = bounds.world_from_axes[place].copy()
    world_from_box[:3, 3] += world_from_box[:3, :3] @ ((low + high) / 2)
    size = high - low
    return Box3D(
        center=_three(world_from_box[:3, 3]),
        size=_three(size),
        size_m=_three(size * meters_per_unit),
        world_from_box=world_from_box.tolist(),
        camera_from_box=(camera.opencv_camera_from_world @ world_from_box).tolist(),
        extent=_extent(bounds, place),
        world_from_prim=bounds.world_from_prim[place].tolist(),
    )


def _extent(bounds: Bounds, place: int) -> Sequence[Sequence[float]] | None:
    """Return the corners in the prim's own space."""
    if place in bounds.sheared:
        low, high = bounds.sheared[place].tolist()
        return [low, high]
    scales = np.einsum("ij,ij->j", bounds.world_from_axes[place][:3, :3], bounds.world_from_prim[place][:3, :3])
    if not (np.abs(scales) > 0).all():
        return None
    corners = bounds.corners[place] / scales
    return [corners.min(axis=0).tolist(), corners.max(axis=0).tolist()]


def _three(values: Doubles) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
