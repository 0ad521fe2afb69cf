"""Rendered objects with their world boxes, and their exact extent along a direction, to frame cameras by.

An object is a shape that is placed once, or one instance of a prototype. Objects come from the translated scene, so hidden
prims and purposes that are not rendered are not among them. Outliers (skies, grounds and stray objects that would make the
rest a dot if they were framed) are judged by world boxes and by `detail`, the weight of each object.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ...description import Mesh, NurbsPatch, Placed, Placement, Prototype, SceneDescription, Shape, Sphere, SubdivisionMesh
from ...description.placement import Box, placed_box, transformed_box, transformed_boxes
from ...description.volumes import VolumeEmission, VolumeMedium, instance_boxes, volume_box
from ..scene.bounds import Bounds

Ints = npt.NDArray[np.intp]
Volume = VolumeMedium | VolumeEmission

Mask = npt.NDArray[np.bool_]
CURVED_FACES = 64  # faces that a sphere counts as
MOST_EXACT_OBJECTS = 256  # objects whose points are tested along one direction; others count by their boxes
FARTHEST = 1e100  # boxes beyond are left out: sums and products of their corners could overflow
MOST_BOUNDED_INSTANCES = 1_000_000  # up to this many instances of a placement, the corners of each are bounded
# Placements with more instances together share this number evenly: an object takes 200 bytes for as long as they are judged.
MOST_BOUNDED_TOGETHER = 4_000_000
ROWS = 1 << 18  # points in double precision at a time
SMALL, TOGETHER = 256, 1 << 14  # points of meshes that are bounded together, and meshes at a time


@dataclass(frozen=True)
class FramedObject:
    """An object in its own space, which may be placed several times; without `parts` only its box is known."""

    path: str
    box: Box
    parts: tuple[tuple[Shape, Doubles], ...] = ()  # with matrices (4, 4)
    detail: float = 1.0
    is_light: bool = False


@dataclass(frozen=True, eq=False)
class ObjectPlacements:
    """Placements of one object: all instances of a Placement in order, or a single matrix (3, 4)."""

    thing: FramedObject
    low: Doubles  # (K, 3) world
    high: Doubles
    where: Placement | Doubles

    @property
    def details(self) -> Doubles:
        return np.full(len(self.low), self.thing.detail)

    @property
    def are_lights(self) -> Mask:
        return np.full(len(self.low), self.thing.is_light)

    def object_at(self, k: int) -> FramedObject:
        return self.thing

    def paths(self, chosen: Ints) -> list[str]:
        return [self.thing.path]

    def matrix(self, k: int) -> Doubles:
        """Return world_from_thing (3, 4) of instance k."""
        if not isinstance(self.where, Placement):
            return self.where
        world = np.eye(4)
        for level in reversed(self.where.levels):
            k, inner = divmod(k, len(level))
            outer = np.eye(4)
            outer[:3] = level.rows(inner, inner + 1)[0]
            world = outer @ world
        return world[:3]


@dataclass(frozen=True, eq=False)
class StaticShapes:
    """Shapes that are placed once, of which there may be a million: each is an object, made when it is asked for."""

    shapes: Sequence[Shape]  # (N)
    boxes: Box  # (N, 3) corners, in the shapes' own spaces
    matrices: Doubles  # (N, 4, 4)
    low: Doubles  # (N, 3) world
    high: Doubles

    @cached_property
    def details(self) -> Doubles:
        known: dict[int, float] = {}
        faces = list(map(_face_count, self.shapes))
        for count in faces:
            if count not in known:
                known[count] = _detail_of(count)
        return np.array([known[count] for count in faces])

    @cached_property
    def are_lights(self) -> Mask:
        return np.array([shape.light is not None for shape in self.shapes], bool)

    def object_at(self, k: int) -> FramedObject:
        shape, box = self.shapes[k], (self.boxes[0][k], self.boxes[1][k])
        return FramedObject(shape.path, box, ((shape, np.eye(4)),), _detail([shape]), shape.light is not None)

    def paths(self, chosen: Ints) -> list[str]:
        return [self.shapes[k].path for k in chosen.tolist()]

    def matrix(self, k: int) -> Doubles:
        """Return world_from_shape (3, 4)."""
        matrix: Doubles = self.matrices[k, :3]
        return matrix


class FramedObjects:
    """Objects with finite boxes: `low` and `high` (N, 3) are the world boxes, `detail` (N,) grows with the number of faces."""

    def __init__(self, stands: Sequence[ObjectPlacements | StaticShapes], kept: Mask | None = None) -> None:
        self._stands = stands
        self._sizes = np.array([len(stand.low) for stand in stands], np.intp)
        self._ends = np.cumsum(self._sizes)
        low = np.concatenate([stand.low for stand in stands]) if stands else np.zeros((0, 3))
        high = np.concatenate([stand.high for stand in stands]) if stands else np.zeros((0, 3))
        if kept is None:
            kept = (np.abs(low) < FARTHEST).all(axis=1) & (np.abs(high) < FARTHEST).all(axis=1)
        self._numbers = np.flatnonzero(kept)
        self.low, self.high = low[self._numbers], high[self._numbers]
        self._points: dict[int, Floats] = {}

    def __len__(self) -> int:
        return len(self._numbers)

    def only(self, kept: Mask) -> FramedObjects:
        """Return the objects that the mask (N,) chooses."""
        chosen = np.zeros(sum(self._sizes), bool)
        chosen[self._numbers[kept]] = True
        return FramedObjects(self._stands, chosen)

    def with_box(self, low: Doubles, high: Doubles) -> FramedObjects:
        """Return these objects and one more, of which only its world box is known: corners (3,)."""
        chosen = np.zeros(sum(self._sizes) + 1, bool)
        chosen[self._numbers] = chosen[-1] = True
        return FramedObjects(
            [*self._stands, ObjectPlacements(FramedObject("", (low, high)), low[None], high[None], np.eye(4)[:3])], chosen
        )

    @cached_property
    def detail(self) -> Doubles:
        return np.concatenate([stand.details for stand in self._stands])[self._numbers]

    @cached_property
    def is_light(self) -> Mask:
        return np.concatenate([stand.are_lights for stand in self._stands])[self._numbers]

    def paths(self, chosen: Mask) -> list[str]:
        """Return the paths of the objects that the mask (N,) chooses, each once."""
        numbers = self._numbers[chosen]
        stands = np.searchsorted(self._ends, numbers, side="right")
        some, first = np.unique(stands, return_index=True)
        rows = np.split(numbers - (self._ends - self._sizes)[stands], first[1:])
        found = zip(some.tolist(), rows, strict=True) if len(numbers) else ()
        return list(dict.fromkeys(path for s, own in found for path in self._stands[s].paths(own)))

    def reach(self, direction: Doubles, origin: Doubles) -> float:
        """Return the largest dot product of `direction` (3,) with any point of the objects, relative to `origin` (3,)."""
        bounds = self._centers @ direction + self._halves @ np.abs(direction) - origin @ direction
        first = int(np.argmax(bounds))
        best = self._reach_of(first, bounds, direction, origin, -math.inf)
        others = np.flatnonzero(bounds > best)
        others = others[np.argsort(-bounds[others], kind="stable")]
        for k in others[:MOST_EXACT_OBJECTS].tolist():
            if bounds[k] > best and k != first:
                best = max(best, self._reach_of(k, bounds, direction, origin, best))
        return max(best, float(bounds[others[MOST_EXACT_OBJECTS]])) if len(others) > MOST_EXACT_OBJECTS else best

    @cached_property
    def _centers(self) -> Doubles:
        return (self.low + self.high) / 2

    @cached_property
    def _halves(self) -> Doubles:
        return (self.high - self.low) / 2

    def _reach_of(self, k: int, bounds: Doubles, direction: Doubles, origin: Doubles, enough: float) -> float:
        """Return the extent of one object, at most its bound; parts that cannot exceed `enough` are skipped."""
        number = int(self._numbers[k])
        s = int(np.searchsorted(self._ends, number, side="right"))
        k_of_stand = number - int(self._ends[s]) + self._sizes[s]
        thing, world = self._stands[s].object_at(k_of_stand), self._stands[s].matrix(k_of_stand)
        offset = float(direction @ (world[:, 3] - origin))
        along = direction @ world[:, :3]
        if not thing.parts:
            return min(offset + _box_extent(thing.box, along), float(bounds[k]))
        found = -math.inf
        for shape, matrix in thing.parts:
            own, start = along @ matrix[:3, :3], offset + float(along @ matrix[:3, 3])
            if start + _box_extent(self._box(shape), own) > max(found, enough):
                found = max(found, start + self._shape_reach(shape, own))
        return min(found, float(bounds[k]))

    def _box(self, shape: Shape) -> Box:
        if not isinstance(shape, Mesh | SubdivisionMesh | NurbsPatch):
            return shape.box()
        points = self._drawn_points(shape)
        return points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)

    def _shape_reach(self, shape: Shape, along: Doubles) -> float:
        if isinstance(shape, Mesh | SubdivisionMesh | NurbsPatch):
            points = self._drawn_points(shape)
            return max(float((points[k : k + ROWS].astype(np.float64) @ along).max()) for k in range(0, len(points), ROWS))
        return abs(shape.radius) * float(np.linalg.norm(along)) if type(shape) is Sphere else _box_extent(shape.box(), along)

    def _drawn_points(self, shape: Mesh | SubdivisionMesh | NurbsPatch) -> Floats:
        if id(shape) not in self._points:
            self._points[id(shape)] = shape.drawn_points()
        return self._points[id(shape)]


def framed_objects(
    shapes: Sequence[Shape],
    static: Sequence[Placed],
    prototypes: Sequence[Prototype],
    placements: Sequence[Placement],
    volumes: Sequence[Volume] = (),
) -> FramedObjects:
    """Return the scene's objects, without geometry lights unless there is nothing else; a unit box if it is empty."""
    stands: list[ObjectPlacements | StaticShapes] = [*_static_objects(shapes, static)]
    stands += [*_instanced_objects(shapes, prototypes, placements), *_volume_objects(volumes)]
    found = FramedObjects(stands)
    if len(found) == 0:
        half = np.full(3, 0.5)
        return FramedObjects([ObjectPlacements(FramedObject("", (-half, half)), -half[None], half[None], np.eye(4)[:3])])
    is_mixed = found.is_light.any() and not found.is_light.all()
    return found.only(~found.is_light) if is_mixed else found


def framed_bounds(description: SceneDescription, up: int) -> Box:
    """Return the low and high corner (3,) of the scene without outliers; the lowest point along the up axis is exact."""
    things = framed_objects(
        description.shapes, description.static, description.prototypes, description.placements, description.volumes
    )
    things = things.only(~outliers(things.low, things.high, things.detail, up))
    low, high = things.low.min(axis=0), things.high.max(axis=0)
    down = np.zeros(3)
    down[up] = -1.0
    low[up] = -things.reach(down, np.zeros(3))
    return low, high


def _static_objects(shapes: Sequence[Shape], static: Sequence[Placed]) -> Iterator[StaticShapes]:
    if not static:
        return
    own = [shapes[placed.shape] for placed in static]
    boxes = boxes_of(own)
    matrices = np.stack([placed.matrix for placed in static])
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = transformed_boxes(matrices, *boxes)
    yield StaticShapes(own, boxes, matrices, low, high)


def boxes_of(shapes: Sequence[Shape]) -> Box:
    """Return the low and high corners (N, 3) of shapes' boxes, as `Shape.box` does; small meshes are bounded together."""
    low, high = np.empty((len(shapes), 3)), np.empty((len(shapes), 3))
    small: list[int] = []
    for k, shape in enumerate(shapes):
        if type(shape) is Mesh and len(shape.points) <= SMALL:
            small.append(k)
        else:
            low[k], high[k] = shape.box()
    for start in range(0, len(small), TOGETHER):
        some = small[start : start + TOGETHER]
        low[some], high[some] = _boxes_of_meshes([shapes[k] for k in some])
    return low, high


def _boxes_of_meshes(meshes: Sequence[Shape]) -> Box:
    """Return the boxes of meshes; those of the same arrays are bounded once."""
    numbers: dict[tuple[int, int], int] = {}
    own, distinct = [], list[Mesh]()
    for mesh in meshes:
        assert isinstance(mesh, Mesh)
        key = (id(mesh.points), id(mesh.triangles))
        number = numbers.setdefault(key, len(distinct))
        if number == len(distinct):
            distinct.append(mesh)
        own.append(number)
    points = np.concatenate([mesh.points for mesh in distinct])
    counts = np.array([len(mesh.points) for mesh in distinct])
    starts = np.cumsum(counts) - counts
    corners = np.array([mesh.triangles.size for mesh in distinct])
    is_used = np.zeros(len(points), bool)
    is_used[np.concatenate([mesh.triangles.ravel() for mesh in distinct]) + np.repeat(starts, corners)] = True
    if not is_used.all():
        points, counts = points[is_used], np.add.reduceat(is_used.astype(np.intp), starts)
        starts = np.cumsum(counts) - counts
    low, high = np.minimum.reduceat(points, starts, axis=0), np.maximum.reduceat(points, starts, axis=0)
    return low.astype(np.float64)[own], high.astype(np.float64)[own]


def _instanced_objects(
    shapes: Sequence[Shape], prototypes: Sequence[Prototype], placements: Sequence[Placement]
) -> Iterator[ObjectPlacements]:
    things = {number: _prototype_object(shapes, prototypes, number) for number in {p.prototype for p in placements}}
    are_many = sum(map(len, placements)) > MOST_BOUNDED_TOGETHER
    most = min(MOST_BOUNDED_INSTANCES, MOST_BOUNDED_TOGETHER // len(placements)) if are_many else MOST_BOUNDED_INSTANCES
    for placement in placements:
        thing = things[placement.prototype]
        if len(placement) > most:
            low, high = placed_box(placement.levels, thing.box)
            around = FramedObject(thing.path, (low, high), (), thing.detail + math.log2(len(placement)), thing.is_light)
            yield ObjectPlacements(around, low[None], high[None], np.eye(4)[:3])
        elif len(placement):
            with np.errstate(over="ignore", invalid="ignore"):
                boxes = [transformed_box(rows, thing.box) for rows in placement.chunks()]
            yield ObjectPlacements(
                thing, np.concatenate([b[0] for b in boxes]), np.concatenate([b[1] for b in boxes]), placement
            )


def _volume_objects(volumes: Sequence[Volume]) -> Iterator[ObjectPlacements]:
    """Yield volumes by the boxes of their instances; a grid that several media share counts once."""
    seen: set[tuple[str, bytes]] = set()
    for volume in volumes:
        boxes = instance_boxes(volume)
        if boxes is None or not len(boxes[0]) or (key := (volume.path, boxes[0].tobytes())) in seen:
            continue
        seen.add(key)
        for low, high in zip(*boxes, strict=True):
            yield ObjectPlacements(FramedObject(volume.path, (low, high)), low[None], high[None], np.eye(4)[:3])


def _prototype_object(shapes: Sequence[Shape], prototypes: Sequence[Prototype], number: int) -> FramedObject:
    prototype = prototypes[number]
    parts = tuple((shapes[placed.shape], placed.matrix) for placed in prototype.shapes)
    inner = [prototypes[p.prototype] for p in prototype.placements]
    members = [shape for shape, _ in parts] + [shapes[placed.shape] for p in inner for placed in p.shapes]
    known = () if inner else parts
    are_lights = all(shape.light is not None for shape in members)
    return FramedObject(prototype.path, prototype_box(shapes, prototypes, number), known, _detail(members), are_lights)


def _detail(shapes: Sequence[Shape]) -> float:
    """Return an object's weight, which grows with the logarithm of its number of faces."""
    return _detail_of(sum(map(_face_count, shapes)))


def _detail_of(faces: int) -> float:
    return 1.0 + math.log2(1 + faces)


def _face_count(shape: Shape) -> int:
    if isinstance(shape, Mesh):
        return len(shape.triangles)
    return len(shape.face_counts) if isinstance(shape, SubdivisionMesh) else CURVED_FACES


def _box_extent(box: Box, along: Doubles) -> float:
    return float(np.where(along > 0, box[1], box[0]) @ along)


def shape_bounds(
    shapes: Sequence[Shape],
    static: Sequence[Placed],
    prototypes: Sequence[Prototype],
    placements: Sequence[Placement],
    volumes: Sequence[Volume] = (),
) -> Bounds:
    """Return centre and size of the translated scene, by the corners of shapes' boxes; a unit box if it is empty."""
    corners = [corners_of(shapes[p.shape]) @ p.matrix[:3, :3].T + p.matrix[:3, 3] for p in static]
    corners += [np.array(box) for box in map(volume_box, volumes) if box is not None]
    for placement in placements:
        if prototypes[placement.prototype].placements or len(placement) > MOST_BOUNDED_INSTANCES:
            corners.append(np.array(placed_box(placement.levels, prototype_box(shapes, prototypes, placement.prototype))))
            continue
        for p in prototypes[placement.prototype].shapes:
            local = corners_of(shapes[p.shape]) @ p.matrix[:3, :3].T + p.matrix[:3, 3]
            for world in placement.chunks():
                at = (local @ world[:, :, :3].transpose(0, 2, 1) + world[:, None, :, 3]).reshape(-1, 3)
                corners.append(np.array([at.min(axis=0), at.max(axis=0)]))
    if not corners:
        return np.zeros(3), np.ones(3)
    low = np.min([c.min(axis=0) for c in corners], axis=0)
    high = np.max([c.max(axis=0) for c in corners], axis=0)
    return (low + high) / 2, high - low


def prototype_box(shapes: Sequence[Shape], prototypes: Sequence[Prototype], number: int) -> Bounds:
    """Return the low and high corner of a prototype in its own space."""
    p = prototypes[number]
    boxes = [placed_box(inner.levels, prototype_box(shapes, prototypes, inner.prototype)) for inner in p.placements]
    for placed in p.shapes:
        at = corners_of(shapes[placed.shape]) @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]
        boxes.append((at.min(axis=0), at.max(axis=0)))
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def corners_of(shape: Shape) -> Doubles:
    """Return the corners (8, 3) of a shape's box."""
    low, high = shape.box()
    pick = np.array([[(k >> axis) & 1 for axis in range(3)] for k in range(8)], bool)
    return np.where(pick, high, low)


STRAY = 10.0  # strays are this many times as far from the middle as anything nearer
MAJORITY = 2 / 3  # share of the detail that is never stray
GROUND = 4.0  # a ground is this many times as wide as all that is on it
SKY = 8.0  # a sky is this many times as wide as all that it encloses
LONE = 3.0  # factor on both if a single object would remain, which may be a small part of a large one
# Range of what a sky encloses, as shares from its middle to its sides and from its bottom to its top; objects on or in a solid
# body are often beyond it.
INNER, BELOW = 0.5, 0.75
FLAT = 0.1  # a ground's height over its width
MOST_SURROUNDINGS = 1000  # objects that are tested as surroundings
SAMPLED = 1 << 16  # objects by which the median is estimated
SURROUND_TOLERANCE = 0.05  # tolerance, as a share of its size, by which surroundings may miss what they surround


def outliers(low: Doubles, high: Doubles, detail: Doubles, up: int) -> Mask:
    """Return the mask (N,) of outliers, which are never all objects."""
    out = np.zeros(len(low), bool)
    for found in (strays, surroundings, strays):  # a ground hides what has strayed, and the other way round
        rest = np.flatnonzero(~out) if out.any() else slice(None)
        more = found(low[rest], high[rest], detail[rest], up)
        out[rest] = more
        if found is surroundings and not more.any():
            break
    return out


def strays(low: Doubles, high: Doubles, detail: Doubles, up: int) -> Mask:
    """Return the mask of objects far from the majority, by distance from its middle, without objects in between."""
    middle = np.array([_weighted_quantile(0.5, (low + high)[:, axis] / 2, detail) for axis in range(3)])
    above, below = high - middle, middle - low
    far = _row_maximum(np.maximum(np.abs(above), np.abs(below)))
    near = _row_maximum(np.maximum(-above, -below))
    reach = _weighted_quantile(MAJORITY, far, detail)
    while (farther := near[near <= STRAY * reach].max(initial=reach)) > reach:
        reach = farther
    return np.asarray((near > STRAY * reach) & (reach > 0))


def surroundings(low: Doubles, high: Doubles, detail: Doubles, up: int) -> Mask:
    """Return the mask of the widest objects that surround everything narrower: flat below it, or enclosing it."""
    across = [axis for axis in range(3) if axis != up]
    size = high - low
    wide = size[:, across].max(axis=1)
    order = _widest(wide)
    is_flat = size[order, up] <= FLAT * wide[order]
    slack = SURROUND_TOLERANCE * size[order]
    slack[is_flat, up] = np.inf
    # Row k: bounds of everything narrower than the k-th, and of the k-th and everything wider.
    around_low = _accumulated_from_end(np.maximum, low[order] - slack)
    around_high = _accumulated_from_end(np.minimum, high[order] + slack)
    left = len(low) - len(order) + np.arange(len(order))  # things
    holds = _accumulated_from_end(np.minimum, wide[order] / np.where(is_flat, GROUND, SKY)) / np.where(left == 1, LONE, 1.0)
    inner_low, inner_high = _narrower(np.minimum, low, order), _narrower(np.maximum, high, order)
    extent = (inner_high - inner_low).max(axis=1)
    goes_around = (around_low <= inner_low).all(axis=1) & (around_high >= inner_high).all(axis=1)
    is_inside = is_flat | _is_well_inside(inner_low, inner_high, low[order], high[order], up)
    is_inside = np.logical_and.accumulate(is_inside[::-1])[::-1]
    found = goes_around & is_inside & (holds >= extent) & (extent > 0)
    out = np.zeros(len(low), bool)
    if found.any():
        out[order[np.argmax(found) :]] = True
    return out


def _is_well_inside(inner_low: Doubles, inner_high: Doubles, low: Doubles, high: Doubles, up: int) -> Mask:
    """Return whether what is enclosed is near the sky's horizontal middle and not near its top, (M,)."""
    across = [axis for axis in range(3) if axis != up]
    with np.errstate(over="ignore", invalid="ignore"):
        aside = np.abs((inner_low + inner_high) - (low + high))[:, across] <= INNER * (high - low)[:, across]
    return np.asarray(aside.all(axis=1) & (inner_high[:, up] <= low[:, up] + BELOW * (high - low)[:, up]))


def _widest(wide: Doubles) -> Ints:
    """Return the indices of at most MOST widest objects, never of all, in ascending order of width."""
    most = min(MOST_SURROUNDINGS, len(wide) - 1)
    chosen = np.argpartition(wide, -most)[-most:] if most > 0 else np.zeros(0, np.intp)
    return np.asarray(chosen[np.argsort(wide[chosen], kind="stable")])


def _narrower(combine: np.ufunc, values: Doubles, order: Ints) -> Doubles:
    """Return (M, 3): row k combines all values but those of the k-th in the order and later ones."""
    is_rest = np.ones(len(values), bool)
    is_rest[order] = False
    return np.asarray(combine.accumulate(np.vstack([combine.reduce(values[is_rest])[None], values[order]]))[:-1])


def _weighted_quantile(part: float, values: Doubles, weights: Doubles) -> float:
    """Return the weighted quantile: for a half, the median."""
    every = 1 + len(values) // SAMPLED
    values, weights = values[::every], weights[::every]
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(sums, part * sums[-1])]])


def _row_maximum(rows: Doubles) -> Doubles:
    """Return the maximum (N,) of rows (N, 3); NumPy's own maximum along short rows takes five times as long."""
    return np.asarray(np.maximum(np.maximum(rows[:, 0], rows[:, 1]), rows[:, 2]))


def _accumulated_from_end(combine: np.ufunc, values: Doubles) -> Doubles:
    return np.asarray(combine.accumulate(values[::-1])[::-1])
