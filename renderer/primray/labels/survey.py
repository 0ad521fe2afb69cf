"""A survey of a picture's things: how much of each is seen, in the frame and beside it, and where it is.

Rays through the pixels' centres pass everything on their way, each thing once. Those that pass a thing would show it if it were
alone; those that hit it first do show it. Rays on a canvas of 3 x 3 frames count what the frame cuts off.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..arrays import Doubles, Floats
from .boxes import bounds_of, box_3d, has_few_parts, parts_of_scene
from .layers import NO_COUNTS, Counts, Numbers, PartNames, Passed, TaxonomyThings, in_bands, passed_by, wilson_interval
from .silhouettes import Silhouettes
from .things import Box, Box3D, Depth, Keypoint

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..description.scene import PixelWindow
    from ..report.prepared import Prepared
    from ..settings import RenderSettings

PLANES = ("prim", "instance", "outer", "depth")
ENOUGH_RAYS = 400  # through a thing, for its occlusion; those of a smaller one are closer to each other
FINEST = 16  # rays along a pixel's side
MOST_RAYS = 1 << 16  # of a smaller thing
BOX_PIXELS, BOX_SHARE = 2.0, 0.02  # by which boxes on the film are widened: spheres and curves are bounded by points on them
KEYPOINT_DEPTH = 0.02  # how far below a surface a keypoint counts as visible, as a share of its thing's diagonal


class Survey:
    """What rays through a picture's pixels pass, and what the things there are.

    `planes`: those of PLANES, (H, W, 1), where the first hits of the pixels' centres are known.
    """

    def __init__(self, prepared: Prepared, parts: PartNames, planes: Mapping[str, npt.NDArray[Any]] | None = None) -> None:
        self._prepared, self._planes = prepared, planes
        self._scene, self._settings = prepared.scene, prepared.settings
        self._window = prepared.frame.pixels
        self._parts = parts
        self._bands: list[Passed] = []
        self._all_parts = np.zeros((0, 3), np.int32)

    def frame(self) -> tuple[Numbers, Floats]:
        """Return the part (H, W) that each pixel shows, -1 for none, and its depth."""
        if self.boxes_hold_things:
            return self._first_hits()
        centres = _centres(self._window)
        self._bands = list(passed_by(self._scene, centres, self._parts, self._settings))
        return _first_of(self._bands, self._window)

    def _first_hits(self) -> tuple[Numbers, Floats]:
        planes = self._planes
        if planes is None:
            planes = core.first_hits(self._scene, PLANES, [], self._settings).planes
        shape, instance, outer = (planes[name][..., 0] for name in PLANES[:3])
        index, hit = np.full(shape.shape, -1, np.int64), shape != -1
        index[hit] = self._parts.number_columns(shape[hit], instance[hit], outer[hit])
        return index, np.asarray(planes["depth"][..., 0], np.float32)

    @cached_property
    def boxes_hold_things(self) -> bool:
        """Whether things are nowhere but in their boxes on the film, and all of them are known.

        Then rays need to pass what they hit first only where there are boxes of others, and what they hit first is what AOVs
        show. Lenses and shutters that bend edges are followed by points along these, and a panorama's boxes lack its poles.
        """
        prepared = self._prepared
        is_plain = prepared.camera.distortion is None and not prepared.rolls and not prepared.settings.silhouettes
        return is_plain and has_few_parts(self._scene)

    def find_parts(self, things: Iterable[TaxonomyThings]) -> None:
        """Find all parts of the scene, also those that no pixel shows, and the things that hold them."""
        self._all_parts = parts_of_scene(self._scene, self._parts.parts())
        self._parts.number(self._all_parts)
        for one in things:
            one.places()

    def measured(self, things: TaxonomyThings, places: Numbers, depth: npt.NDArray[Any]) -> dict[int, dict[str, Any]]:
        """Return by place what is known of the things on the canvas: the fields of Thing that are measured.

        `places` (H, W) and `depth` are the pixels' innermost things and depths.
        """
        labelled, camera = self._prepared.labelled, self._prepared.camera
        assert labelled is not None
        bounds = bounds_of(self._scene, self._all_parts, self._parts, things, labelled, self._settings)
        film = bounds.film - np.array([self._window.x, self._window.y] * 2)
        silhouettes = Silhouettes(len(film), self._window) if self._settings.silhouettes else None
        inside = self._inside(things, places, film, bounds.is_cut, silhouettes).sized(len(film))
        outside = self._outside(things, film, silhouettes).sized(len(film))
        means = _mean_depths(things, places, depth)
        found: dict[int, dict[str, Any]] = {}
        for n in np.flatnonzero((inside.passing + outside.passing > 0) | self._is_on_canvas(film)).tolist():
            visible, in_frame = int(inside.first[n]), int(inside.passing[n])
            every = in_frame + int(outside.passing[n])
            box_all = _box(film[n])
            box_loose = self._clipped(box_all)
            rays, hits = self._occlusion_rays(things, n, box_loose, (in_frame, visible))
            oriented = box_3d(bounds, n, camera, labelled.meters_per_unit)
            found[n] = {
                "pixels_visible": visible,
                "pixels_in_frame": in_frame,
                "pixels_all": every,
                "truncation": 1 - in_frame / every if every else None,
                "occlusion": 1 - hits / rays if rays else None,
                "occlusion_interval": wilson_interval(rays - hits, rays) if rays else None,
                "box_loose": box_loose,
                "box_all": box_all,
                "box_3d": oriented,
                "depth": Depth(
                    nearest=_finite(bounds.nearest[n]),
                    mean=_finite(means[n]),
                    center=None if oriented is None else float(oriented.camera_from_box[2][3]),
                ),
            }
            if silhouettes is not None:
                found[n]["silhouette"] = silhouettes.of(n)
        self._add_keypoints(found, things)
        return found

    def _inside(
        self,
        things: TaxonomyThings,
        places: Numbers,
        film: Doubles,
        is_cut: npt.NDArray[np.bool_],
        silhouettes: Silhouettes | None,
    ) -> Counts:
        """Return the counts of rays through the frame's pixels."""
        if not self.boxes_hold_things:
            counts = NO_COUNTS
            for band, points in zip(self._bands, in_bands(_centres(self._window)), strict=True):
                counts += band.counts(things)
                if silhouettes is not None:
                    silhouettes.add(points, *band.rays(things))
            return counts
        first = np.bincount(places[places >= 0], minlength=len(film))
        for n in reversed(range(len(film))):  # what a thing holds is after it
            if (parent := things.hierarchy.parents[n]) >= 0:
                first[parent] += first[n]
        # Add what is behind the first hit, where there are boxes of other things than those that are hit there.
        height, width = places.shape
        boxes = np.zeros((height + 1, width + 1), np.int32)
        for box, is_anywhere in zip(film, is_cut, strict=True):
            x0, y0, x1, y1 = 0, 0, width, height
            if not is_anywhere:
                if not np.isfinite(box).all():
                    continue
                margin = BOX_PIXELS + BOX_SHARE * (box[2:] - box[:2]).max()
                x0, y0 = (max(0, min(math.floor(v - margin), size)) for v, size in zip(box[:2], (width, height), strict=True))
                x1, y1 = (max(0, min(math.ceil(v + margin), size)) for v, size in zip(box[2:], (width, height), strict=True))
            boxes[[y0, y1], [x0, x1]] += 1
            boxes[[y0, y1], [x1, x0]] -= 1
        boxes = boxes.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)[:height, :width]
        levels = np.array([len(things.hierarchy.above(n)) for n in range(len(film))] + [0], np.int32)
        points = _centres(self._window)[(boxes > levels[places]).ravel()]
        counts = Counts(first, first)
        for band in passed_by(self._scene, points, self._parts, self._settings):
            passed = band.counts(things)
            counts += Counts(passed.passing - passed.first, np.zeros_like(passed.first))
        return counts

    def _outside(self, things: TaxonomyThings, film: Doubles, silhouettes: Silhouettes | None) -> Counts:
        """Return the counts of rays on the canvas around the frame, where things go beyond the frame."""
        width, height = self._window.width, self._window.height
        wanted = np.zeros((3 * height, 3 * width), bool)
        size, corner = np.array([3 * width, 3 * height]), np.array([width, height])
        for box in film[np.isfinite(film).all(axis=1)]:
            if (box[:2] < 0).any() or (box[2:] > [width, height]).any():
                x0, y0 = np.clip(np.floor(box[:2]) + corner, 0, size).astype(int).tolist()
                x1, y1 = np.clip(np.ceil(box[2:]) + corner, 0, size).astype(int).tolist()
                wanted[y0:y1, x0:x1] = True
        wanted[height : 2 * height, width : 2 * width] = False
        y, x = np.nonzero(wanted)
        points = np.stack([x + 0.5 - width + self._window.x, y + 0.5 - height + self._window.y], axis=1)
        counts = NO_COUNTS
        for band, own in zip(passed_by(self._scene, points, self._parts, self._settings), in_bands(points), strict=True):
            counts += band.counts(things)
            if silhouettes is not None:
                silhouettes.add(own, *band.rays(things))
        return counts

    def _is_on_canvas(self, film: Doubles) -> npt.NDArray[np.bool_]:
        size = np.array([self._window.width, self._window.height])
        held = (film[:, :2] < 2 * size).all(axis=1) & (film[:, 2:] > -size).all(axis=1)
        return np.asarray(held & np.isfinite(film).all(axis=1))

    def _clipped(self, box: Box | None) -> Box | None:
        if box is None:
            return None
        x0, y0 = max(box[0], 0.0), max(box[1], 0.0)
        x1, y1 = min(box[2], float(self._window.width)), min(box[3], float(self._window.height))
        return (x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None

    def _occlusion_rays(self, things: TaxonomyThings, place: int, box: Box | None, pixels: tuple[int, int]) -> tuple[int, int]:
        """Return how many rays through the frame pass a thing, and how many of them hit it first; `pixels`: those of pixels."""
        if box is None or pixels[0] >= ENOUGH_RAYS:
            return pixels
        x0, y0, x1, y1 = math.floor(box[0]), math.floor(box[1]), math.ceil(box[2]), math.ceil(box[3])
        side = min(math.ceil(math.sqrt(ENOUGH_RAYS / max(pixels[0], 1))), FINEST)
        side = min(side, math.isqrt(MOST_RAYS // max((x1 - x0) * (y1 - y0), 1)))
        if side < 2:
            return pixels
        x = self._window.x + x0 + (np.arange((x1 - x0) * side) + 0.5) / side
        y = self._window.y + y0 + (np.arange((y1 - y0) * side) + 0.5) / side
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        bands = passed_by(self._scene, points, self._parts, self._settings)
        counts = sum((band.counts(things) for band in bands), NO_COUNTS).sized(place + 1)
        return int(counts.passing[place]), int(counts.first[place])

    def _add_keypoints(self, found: dict[int, dict[str, Any]], things: TaxonomyThings) -> None:
        """Add the keypoints of the things that were found."""
        labelled, hierarchy = self._prepared.labelled, things.hierarchy
        assert labelled is not None
        authored = [(n, point) for n in found for point in labelled.keypoints(hierarchy.names[n], hierarchy.taxonomy)]
        if not authored:
            return
        seen = core.project(self._scene, [point.position for _, point in authored])
        first = _first_depths(self._scene, seen[:, :2], self._settings)
        size = np.array([self._window.width, self._window.height])
        for (n, point), (x, y, depth), nearest in zip(authored, seen.tolist(), first.tolist(), strict=True):
            at = (x - self._window.x, y - self._window.y)
            is_inside = bool(np.isfinite(x) and (np.array(at) >= 0).all() and (np.array(at) < size).all())
            radius = _keypoint_depth(found[n]["box_3d"]) if point.radius is None else point.radius
            is_hidden = nearest < depth - radius
            px, py, pz = point.position
            made = Keypoint(
                name=point.name,
                position=(px, py, pz),
                pixel=at if np.isfinite(x) else None,
                depth=depth,
                v=0 if not is_inside else 1 if is_hidden else 2,
            )
            found[n]["keypoints"] = (*found[n].get("keypoints", ()), made)


def first_parts(scene: CoreScene, window: PixelWindow, parts: PartNames, settings: RenderSettings) -> tuple[Numbers, Floats]:
    """Return the part (H, W) that each pixel's centre shows, -1 for none, and its depth."""
    bands = list(passed_by(scene, _centres(window), parts, settings, first_only=True))
    return _first_of(bands, window)


def _centres(window: PixelWindow) -> npt.NDArray[np.float32]:
    x, y = np.arange(window.width, dtype=np.float32), np.arange(window.height, dtype=np.float32)
    grid = np.meshgrid(x + np.float32(window.x + 0.5), y + np.float32(window.y + 0.5))
    return np.stack(grid, axis=-1).reshape(-1, 2)


def _first_of(bands: Sequence[Passed], window: PixelWindow) -> tuple[Numbers, Floats]:
    shape = window.height, window.width
    first, depth = (np.concatenate(values).reshape(shape) for values in zip(*((b.first, b.depth) for b in bands), strict=True))
    return first, depth


def _first_depths(scene: CoreScene, points: Doubles, settings: RenderSettings) -> Doubles:
    """Return the depth of the first surface along rays through points (N, 2); infinite for points that are not seen."""
    found = np.full(len(points), np.inf)
    finite = np.isfinite(points).all(axis=1)
    layers = core.layers(scene, points[finite], settings, first_only=True)
    depths = np.full(int(finite.sum()), np.inf)
    depths[layers.count > 0] = layers.lengths[:, 0]
    found[finite] = depths
    return found


def _mean_depths(things: TaxonomyThings, places: Numbers, depth: npt.NDArray[Any]) -> Doubles:
    """Return the mean depth of each thing's pixels, with the things that it holds; NaN for those without."""
    hierarchy = things.hierarchy
    held = places >= 0
    sums = np.bincount(places[held], weights=depth[held].astype(np.float64), minlength=len(hierarchy.names))
    counts = np.bincount(places[held], minlength=len(hierarchy.names)).astype(np.float64)
    for n in reversed(range(len(hierarchy.names))):
        if (parent := hierarchy.parents[n]) >= 0:
            sums[parent] += sums[n]
            counts[parent] += counts[n]
    return np.asarray(np.divide(sums, counts, out=np.full(len(sums), np.nan), where=counts > 0))


def _keypoint_depth(box: Box3D | None) -> float:
    return 0.0 if box is None else KEYPOINT_DEPTH * math.hypot(*box.size)


def _box(film: Doubles) -> Box | None:
    x0, y0, x1, y1 = film.tolist()
    return (x0, y0, x1, y1) if np.isfinite(film).all() else None


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
