"""Size of cages on the image, from which dice.py derives how finely the core dices them.

A cage that is placed once is examined face by face. Of several instances, the few largest on the image are examined; for the
others only the largest number of pixels per unit of the cage's space counts. Moving cameras are examined along their whole
path, approximated by a few pieces with fixed orientation and linear translation; the rotation within a piece is accounted for
by a wider window.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..arrays import Doubles
from ..description import (
    Camera,
    CameraMotion,
    DisplacedMesh,
    Frame,
    MovingInstances,
    NurbsPatch,
    Placed,
    Placement,
    Projection,
    Prototype,
    Ribbons,
    SceneDescription,
    SubdivisionMesh,
)
from ..description.placement import compose

Diced = SubdivisionMesh | Ribbons | NurbsPatch

# Factor on edge lengths outside the view, where shapes are seen in mirrors and by their shadows only.
OUTSIDE = 4.0
EVERYWHERE = (-1e30, 1e30, -1e30, 1e30)  # window of a lens that may see anything
MARGIN = 0.05  # of the image's size, on each side: filters and lenses reach beyond the edge
MAX_VIEWS = 4
MAX_LEVEL = 10  # at most 2^20 parts of a cage face
GRID, CELLS_APART = 4.0, 8.0  # cells of the grid in Camera.nearest, and closer than how many cells the camera itself counts
WIDER = 2.0  # cages that a view this many times as wide holds are diced as if they were seen whole
WIDEST = 1.0  # radians that a camera may turn between two poses to have one view


@dataclass(frozen=True)
class Projected:
    """Camera as footprints see it: poses, scale and window."""

    poses: tuple[Pose, ...]
    orthographic: bool
    pixels_per_unit: float  # at unit distance, or anywhere for orthographic cameras
    window: Window  # including MARGIN
    sees_around: bool = False  # lens with distortion: nothing is outside the view


@dataclass(frozen=True)
class Footprint:
    projected: Projected
    views: Doubles  # (V, 3, 4) camera_from_object
    density: float  # largest number of pixels per unit of the cage, in all other placements
    sweeps: Doubles  # (V, 3) translation of the camera during the pose, in its own space


def projected(camera: Camera, frame: Frame, motion: CameraMotion | None = None) -> Projected:
    """Return the projection of a camera, or of its whole path: the finest scale, and a window wide enough for its rotation."""
    cameras = (camera,) if motion is None else motion.cameras
    scales, windows = zip(*(_scale_and_window(each, frame) for each in cameras), strict=True)
    parallel = camera.projection is Projection.ORTHOGRAPHIC
    distorts = camera.distortion is not None and not parallel
    window: Window = tuple(f(side) for f, side in zip((min, max, min, max), zip(*windows, strict=True), strict=True))
    poses, angle = camera_poses([each.world_from_camera for each in cameras])
    around = angle > 0 and (parallel or angle > WIDEST)
    if angle > 0 and not around:
        window = widened_window(window, angle)
    return Projected(poses, parallel, max(scales), window, distorts or around)


def _scale_and_window(camera: Camera, frame: Frame) -> tuple[float, Window]:
    """Return the scale and window of the whole frame and anything rendered beyond it, so that a crop has the triangles of the
    whole."""
    left, right, bottom, top = camera.window
    width, height = frame.resolution
    x, y = MARGIN * (right - left), MARGIN * (top - bottom)
    scale = max(width / abs(right - left), height / abs(top - bottom))
    across, down = (right - left) / width, (top - bottom) / height  # per pixel
    pixels = frame.pixels
    beyond_right = max(0, pixels.x + pixels.width - width) * across
    beyond_bottom = max(0, pixels.y + pixels.height - height) * down
    window = (
        left - x - max(0, -pixels.x) * across,
        right + x + beyond_right,
        bottom - y - beyond_bottom,
        top + y + max(0, -pixels.y) * down,
    )
    return scale, window


def footprints(
    description: SceneDescription, kind: type[Diced] = SubdivisionMesh, kept: KeptFootprints | None = None
) -> dict[int, Footprint]:
    """Return the footprint of every cage, ribbon or patch, by its index in `shapes`. `kept`: those of crowds, as seen from
    earlier cameras."""
    cages = {k: s for k, s in enumerate(description.shapes) if isinstance(s, kind)}
    if not cages:
        return {}
    exposure = description.exposure
    motion = description.camera_motion if exposure is not None and exposure.closes > exposure.opens else None
    camera = projected(description.camera, description.frame, motion)
    seen: dict[int, list[_PlacedCage]] = {k: [] for k in cages}
    static = [placed for placed in description.static if placed.shape in cages]
    for placed in static:
        seen[placed.shape].append(_PlacedCage(lambda: iter([np.eye(4)[None, :3]]), placed.matrix, (placed,)))
    for placement in description.placements:
        prototype = description.prototypes[placement.prototype]
        _see(prototype, partial(_transforms, placement), cages, seen, placement)
        for inner in prototype.placements:
            _see(description.prototypes[inner.prototype], _nested(placement, inner, camera), cages, seen, None)
    once = [placed for placed in static if len(seen[placed.shape]) == 1]
    alone = _footprints_placed_once(once, camera)
    if motion is None and (grid := grid_cell(description.camera)) > 0:
        from_grid = _from_grid_point(description.camera, camera, grid)
        steady = [placed for placed in once if _may_stay(_box_of(cages[placed.shape]), placed.matrix, camera, grid)]
        alone |= _footprints_placed_once(steady, from_grid)
        crowds = {k: places for k, places in seen.items() if k not in alone and all(each.of for each in places)}
        alone |= (KeptFootprints() if kept is None else kept).of(cages, crowds, camera, from_grid, grid)
    elif kept is not None:
        kept.forget()
    return {k: alone[k] if k in alone else _footprint(cage, seen[k], camera) for k, cage in cages.items()}


class KeptFootprints:
    """Footprints of crowds, that is of shapes with several instances, from grid points, and the boxes around the crowds: those
    of before, where these are of the very same instances, since there may be millions."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self._boxes: dict[int, tuple[tuple[object, ...], Doubles]] = {}
        self._prints: dict[int, tuple[tuple[object, ...], Projected, Footprint]] = {}

    def of(
        self,
        cages: Mapping[int, Diced],
        crowds: Mapping[int, Sequence[_PlacedCage]],
        camera: Projected,
        from_grid: Projected,
        cell: float,
    ) -> dict[int, Footprint]:
        """Return the footprints from a grid point, of those that a camera near it may see as from there."""
        found: dict[int, Footprint] = {}
        boxes, self._boxes = self._boxes, {}
        prints, self._prints = self._prints, {}
        for k, places in crowds.items():
            made_of = (cages[k], *(one for each in places for one in each.of))
            box = boxes[k][1] if k in boxes and _are_same(boxes[k][0], made_of) else _box_of_crowd(cages[k], places)
            self._boxes[k] = made_of, box
            if not _may_stay(box, np.eye(4), camera, cell):
                continue
            before = prints.get(k)
            if before is not None and _are_same(before[0], made_of) and _sees_alike(before[1], from_grid):
                found[k] = before[2]
            else:
                found[k] = _footprint(cages[k], places, from_grid)
            self._prints[k] = made_of, from_grid, found[k]
        return found


def _are_same(some: tuple[object, ...], others: tuple[object, ...]) -> bool:
    return len(some) == len(others) and all(a is b for a, b in zip(some, others, strict=True))


def _sees_alike(one: Projected, other: Projected) -> bool:
    """Return whether two views from grid points, which look everywhere, are one."""
    poses = one.poses[0].camera_from_world, other.poses[0].camera_from_world
    return one.pixels_per_unit == other.pixels_per_unit and bool(np.array_equal(*poses))


def _box_of(cage: Diced) -> Doubles | None:
    """Return the ends (2, 3) of a box around a shape, as it is at the frame's time; None if it has no points."""
    if isinstance(cage, Ribbons):
        return np.stack(cage.box()) if len(cage.controls) else None
    if not len(cage.points):
        return None
    ends = np.stack([cage.points.min(axis=0), cage.points.max(axis=0)]).astype(np.float64)
    return ends + [[-cage.reach], [cage.reach]] if isinstance(cage, DisplacedMesh) else ends


def _box_of_crowd(cage: Diced, places: Sequence[_PlacedCage]) -> Doubles:
    """Return the ends (2, 3) of a box around the bounding spheres of all instances."""
    center, radius = _bounding_sphere(cage)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for matrices in _chunks(places, Pose(np.eye(4), np.zeros(3))):
        if len(matrices):
            at = matrices[:, :, :3] @ center + matrices[:, :, 3]
            extent = radius * np.sqrt(np.square(matrices[:, :, :3]).sum(axis=(1, 2)))[:, None]
            low, high = np.minimum(low, (at - extent).min(axis=0)), np.maximum(high, (at + extent).max(axis=0))
    return np.stack([low, high])


def grid_cell(camera: Camera) -> float:
    """Return the size of the grid from whose points cages are diced; 0: from the camera itself.

    A camera that says how far the nearest things are is likely to move about them, and their triangles are to stay. Edges of
    what is CELLS_APART cells away become longer or shorter by 11 % at most, of what is twice as far by 5 %.
    """
    if camera.projection is Projection.ORTHOGRAPHIC or camera.distortion is not None:
        return 0.0
    return 2.0 ** float(np.floor(np.log2(camera.nearest / GRID))) if camera.nearest > 0 else 0.0


def _from_grid_point(camera: Camera, seen: Projected, cell: float) -> Projected:
    """Return the view from the grid point nearest to the camera, in all directions."""
    inverse = np.eye(4)
    inverse[:3, 3] = -np.round(camera.world_from_camera[:3, 3] / cell) * cell
    return replace(seen, poses=(Pose(inverse, np.zeros(3)),), window=EVERYWHERE, sees_around=True)


def _may_stay(box: Doubles | None, matrix: Doubles, camera: Projected, cell: float) -> bool:
    """Return whether nothing in a box, which a matrix places, is far outside the view, or close to the camera."""
    if box is None or not np.isfinite(box).all():
        return False
    corners = box[CORNERS, [0, 1, 2]]
    (pose,) = camera.poses
    placed = pose.camera_from_world @ matrix
    x, y, z = placed[:3, :3] @ corners.T + placed[:3, 3:]
    left, right, bottom, top = (WIDER * side for side in camera.window)
    is_seen = (x >= -left * z) & (x <= -right * z) & (y >= -bottom * z) & (y <= -top * z)
    return bool(is_seen.all() and (-z > CELLS_APART * cell).all())


CORNERS = np.array([[(k >> axis) & 1 for axis in range(3)] for k in range(8)])  # of a box, by the ends of its sides


def _footprints_placed_once(static: list[Placed], camera: Projected) -> dict[int, Footprint]:
    """Return the footprints of cages that are placed in the world exactly once, computed together."""
    if not static:
        return {}
    matrices = np.array([placed.matrix[:3] for placed in static])
    views = np.stack([_through(pose, np.eye(4)[None, :3], matrices) for pose in camera.poses], axis=1)
    finite: list[bool] = np.asarray(np.isfinite(views).all(axis=(1, 2, 3))).tolist()
    sweeps = np.array([pose.sweep for pose in camera.poses])
    return {
        p.shape: Footprint(camera, views[i], 0.0, sweeps) if finite[i] else Footprint(camera, views[i, :0], 0.0, sweeps[:0])
        for i, p in enumerate(static)
    }


def _through(pose: Pose, world: Doubles, matrices: Doubles) -> Doubles:
    """Return camera_from_object (K, 3, 4) for every combination of a matrix (3, 4) and a world matrix (3, 4); one of both is
    single."""
    rows = pose.camera_from_world[:3, :3] @ world
    rows[:, :, 3] += pose.camera_from_world[:3, 3]
    made = rows[:, :, :3] @ matrices
    made[:, :, 3] += rows[:, :, 3]
    return np.asarray(made)


@dataclass(frozen=True)
class _PlacedCage:
    chunks: Callable[[], Iterator[Doubles]]  # (K, 3, 4) world_from_prototype
    matrix: Doubles  # (4, 4) prototype_from_object
    of: tuple[object, ...] = ()  # all that both are made of; nothing where they depend on the camera


def _see(
    prototype: Prototype,
    chunks: Callable[[], Iterator[Doubles]],
    cages: Mapping[int, object],
    seen: dict[int, list[_PlacedCage]],
    placement: Placement | None,
) -> None:
    for placed in prototype.shapes:
        if placed.shape in cages:
            of = () if placement is None else (placed, placement)
            seen[placed.shape].append(_PlacedCage(chunks, placed.matrix, of))


def _transforms(placement: Placement) -> Iterator[Doubles]:
    """Yield world_from_prototype (K, 3, 4) in order; for moving instances at all their times, since the worst decides."""
    moving = placement.levels[0]
    yield from moving.matrices if isinstance(moving, MovingInstances) else placement.chunks()


def _nested(outer: Placement, inner: Placement, camera: Projected) -> Callable[[], Iterator[Doubles]]:
    """Return the products of two levels, limited to the few outer instances nearest to the camera, as all would be too many."""
    nearest = np.zeros((0, 3, 4))
    for rows in _transforms(outer):
        nearest = np.concatenate([nearest, rows])
        apart = np.min([pose.distances_in_world(nearest[:, :, 3]) for pose in camera.poses], axis=0)
        nearest = nearest[np.argsort(apart, kind="stable")[:MAX_VIEWS]]
    return lambda: (compose(nearest, rows) for rows in _transforms(inner))


def _footprint(cage: Diced, seen: Sequence[_PlacedCage], camera: Projected) -> Footprint:
    """Return a footprint with the placements that have the most pixels per unit as views, equally many for each camera pose."""
    center, radius = _bounding_sphere(cage)
    found, rest = [], 0.0
    for pose in camera.poses:
        views, left = _views(seen, center, radius, camera, pose)
        found.append(views)
        rest = max(rest, left)
    sweeps = [np.broadcast_to(p.sweep, (len(v), 3)) for p, v in zip(camera.poses, found, strict=True)]
    return Footprint(camera, np.ascontiguousarray(np.concatenate(found)), rest, np.concatenate(sweeps))


def _views(seen: Sequence[_PlacedCage], center: Doubles, radius: float, camera: Projected, pose: Pose) -> tuple[Doubles, float]:
    """Return the views (V, 3, 4) of one pose, and the density of the other placements."""
    views, densities, rest = np.zeros((0, 3, 4)), np.zeros(0), 0.0
    for matrices in _chunks(seen, pose):
        views = np.concatenate([views, matrices])
        densities = np.concatenate([densities, _densities(matrices, center, radius, camera, pose)])
        order = np.argsort(-densities, kind="stable")
        if len(order) > MAX_VIEWS:
            rest = max(rest, float(densities[order[MAX_VIEWS]]))
        views, densities = views[order[:MAX_VIEWS]], densities[order[:MAX_VIEWS]]
    return views, rest


def _chunks(seen: Sequence[_PlacedCage], pose: Pose) -> Iterator[Doubles]:
    """Yield camera_from_object (K, 3, 4) of all placements."""
    for each in seen:
        for world in each.chunks():
            made = _through(pose, world, each.matrix[:3])
            yield made[np.isfinite(made).all(axis=(1, 2))]


def _bounding_sphere(cage: Diced) -> tuple[Doubles, float]:
    if isinstance(cage, Ribbons):
        low, high = cage.box()
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    steps = cage.points[None] if cage.motion is None else cage.motion.points
    if isinstance(cage, SubdivisionMesh):
        if len(cage.face_points) == 0:
            return np.zeros(3), 0.0
        steps = steps[:, np.unique(cage.face_points)]
    used = steps.reshape(-1, 3).astype(np.float64)
    low, high = used.min(axis=0), used.max(axis=0)
    reach = cage.reach if isinstance(cage, DisplacedMesh) else 0.0
    return (low + high) / 2, float(np.linalg.norm(high - low)) / 2 + reach


def _densities(matrices: Doubles, center: Doubles, radius: float, camera: Projected, pose: Pose) -> Doubles:
    """Return the pixels per unit of the object where each placement is nearest, or at its centre if the camera is inside."""
    scale = np.sqrt(np.square(matrices[:, :, :3]).sum(axis=1)).max(axis=1)
    if camera.orthographic:
        return np.asarray(scale * camera.pixels_per_unit)
    at = matrices[:, :, :3] @ center + matrices[:, :, 3]
    extent = scale * radius
    distance = np.maximum(pose.distances(at) - extent, np.maximum(0.25 * extent, 1e-30))
    density = scale * camera.pixels_per_unit / distance
    if camera.sees_around:
        return np.asarray(density)
    beyond = _beyond(at, extent, camera.window)
    if pose.sweep.any():
        beyond &= _beyond(at - pose.sweep, extent, camera.window)
    return np.asarray(np.where(beyond.any(axis=0), density / OUTSIDE, density))


def _beyond(at: Doubles, extent: Doubles, window: Window) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return the masks (5, K) of spheres entirely beyond each side of the view."""
    left, right, bottom, top = window
    x, y, depth = at[:, 0], at[:, 1], -at[:, 2]
    return np.stack(
        [
            x - left * depth < -extent * np.hypot(1, left),
            right * depth - x < -extent * np.hypot(1, right),
            y - bottom * depth < -extent * np.hypot(1, bottom),
            top * depth - y < -extent * np.hypot(1, top),
            depth < -extent,
        ]
    )


Window = tuple[float, float, float, float]  # left, right, bottom, top at unit distance

MOST_POSES = 16
TURN = 0.05  # radians from a piece's middle to its ends, small enough not to need more pieces


@dataclass(frozen=True, eq=False)
class Pose:
    camera_from_world: Doubles  # (4, 4) at the start of the piece, with the orientation at its middle
    sweep: Doubles  # (3,) translation of the camera, in its own space

    def distances(self, points: Doubles) -> Doubles:
        """Return the smallest distance (K,) of the camera to points (K, 3) in its own space."""
        return _distances(points, self.sweep)

    def distances_in_world(self, points: Doubles) -> Doubles:
        """Return the smallest distance (K,) of the camera to points (K, 3) in world space."""
        world_from_camera = np.linalg.inv(self.camera_from_world)
        return _distances(points - world_from_camera[:3, 3], world_from_camera[:3, :3] @ self.sweep)


def _distances(points: Doubles, sweep: Doubles) -> Doubles:
    """Return the distance (K,) of points to the segment from the origin to `sweep`."""
    if not sweep.any():
        return np.asarray(np.linalg.norm(points, axis=1))
    along = np.clip(points @ sweep / (sweep @ sweep), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - along[:, None] * sweep, axis=1))


def camera_poses(cameras: Sequence[Doubles]) -> tuple[tuple[Pose, ...], float]:
    """Return the pieces of a path given by its world_from_camera (4, 4) at several times, and the largest rotation to either
    side within a piece, in radians."""
    first = cameras[0]
    if all(np.array_equal(first, other) for other in cameras):
        return (Pose(np.asarray(np.linalg.inv(first), np.float64), np.zeros(3)),), 0.0
    chosen = np.unique(np.round(np.linspace(0, len(cameras) - 1, min(len(cameras), MOST_POSES + 1))).astype(int))
    ends = [(cameras[a], cameras[b]) for a, b in itertools.pairwise(chosen)]
    while 2 * len(ends) <= MOST_POSES and max(_angle(a, b) for a, b in ends) > 2 * TURN:
        ends = [half for a, b in ends for half in ((a, _middle(a, b)), (_middle(a, b), b))]
    return tuple(_pose(a, b) for a, b in ends), max(_angle(a, b) for a, b in ends) / 2


def _pose(start: Doubles, end: Doubles) -> Pose:
    middle = _middle(start, end)
    middle[:3, 3] = start[:3, 3]
    inverse = np.asarray(np.linalg.inv(middle), np.float64)
    return Pose(inverse, inverse[:3, :3] @ (end[:3, 3] - start[:3, 3]))


def _middle(a: Doubles, b: Doubles) -> Doubles:
    """Return the pose halfway between two: the rotation nearest to the mean of two rotations is the one between them."""
    mean = (a + b) / 2
    u, _, v = np.linalg.svd(mean[:3, :3])
    mean[:3, :3] = u @ v
    return np.asarray(mean)


def _angle(a: Doubles, b: Doubles) -> float:
    """Return the angle between two orientations, in radians."""
    apart = float(np.linalg.norm(a[:3, :3] - b[:3, :3]))
    return 2.0 * float(np.arcsin(min(apart / np.sqrt(8.0), 1.0)))


def widened_window(window: Window, angle: float) -> Window:
    """Return a window that contains everything the given one sees while the camera turns by up to `angle` in any direction."""
    left, right, bottom, top = window
    # Rotation about the view direction moves corners in proportion to their distance from the axis.
    across = angle * float(np.hypot(1.0, max(abs(bottom), abs(top))))
    up = angle * float(np.hypot(1.0, max(abs(left), abs(right))))
    return _turned_slope(left, -across), _turned_slope(right, across), _turned_slope(bottom, -up), _turned_slope(top, up)


def _turned_slope(slope: float, angle: float) -> float:
    turned = float(np.arctan(slope)) + angle
    return float(np.tan(turned)) if abs(turned) < 1.5 else float(np.sign(turned) * 1e30)
