"""Light meters as a scene: small white facets, and a camera whose rays start just before them.

A Lambertian facet of albedo 1 sends back the radiance E / pi, so a picture of it is its illuminance, and is sampled as any
other surface is: by lights, by guides, with its error from two replicates. A meter has a block of pixels, of which each is a
picture of the same facet, or of one of the sides of an upright prism for a cylinder: these are slim facets in a stack, whose
planes all hold the axis, so that they see each other edge-on. A prism would have its sides off the axis, and a lamp overhead
would not light them. The facets are so small that they hide and reflect nothing that matters; they look away from what they lie
on, half a millimetre above it. Meters that are close together would see each other's facets, and are measured one after the
other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ..arrays import Doubles
from ..camera import FARTHEST, Camera, Projection
from ..description import Mesh, Placed, SceneDescription, Surface
from ..lens.distortion import DirectionTable, Distortion, DistortionModel
from .meters import MeterKind, Meters

BLOCK = 8  # pixels across of a meter's block
SIDES = BLOCK * BLOCK  # of the prism that stands for a cylinder: off by at most 2 / (SIDES^2 - 1) of the light, 0.05 %
HALF = 2.5e-4  # half the width of a facet, in metres
COARSEST = 2e-6  # half that width over the extent of the meters that are measured together, at least: lengths are floats there
FARTHEST_TOGETHER = 1000.0  # metres between meters that are measured together: facets are at most 4 mm wide
# The same of cylinders, whose facets are slim and close together: where rounding moves rays off the axis by more than a
# thousandth of a facet's width, these see each other. Their facets are at most 1 mm wide.
COARSEST_CYLINDER, FARTHEST_CYLINDERS = 5e-5, 10.0
SLIM = 1 / 8  # height over width of a cylinder's facets
PIXEL = 0.002  # of the camera, in radians: what is seen of textures and of how finely shapes are diced
APART = 100.0  # widths of a facet between meters that are measured together
PATH = "primray:meters"
# Places of a cylinder's facets in their stack, scattered, so that what is seen higher up is not seen on one side only.
_ORDER = [int(f"{k:06b}"[::-1], 2) for k in range(SIDES)]


@dataclass(frozen=True)
class Facets:
    """Corners (N, SIDES, 4, 3) and unit normals (N, SIDES, 3) of the facets of N meters, relative to `origin` (3,)."""

    origin: Doubles
    corners: Doubles
    normals: Doubles

    @property
    def aims(self) -> Doubles:
        """Points (N, SIDES, 3) that rays are aimed at: above the facets' middles, which are on the edge of both triangles."""
        return np.asarray(np.tensordot(self.corners, [0.125, 0.125, 0.375, 0.375], axes=([2], [0])))

    @property
    def away(self) -> Doubles:
        """Unit directions (N, SIDES, 3) from the facets to where rays start.

        They are between a side's normal and the next one's: a ray along a normal of a cylinder would lie in the plane of the
        facet that is at right angles to it, higher or lower in the stack, and Embree finds hits far outside of such triangles.
        """
        aside = self.corners[:, :, 1] - self.corners[:, :, 0]
        aside /= np.linalg.norm(aside, axis=-1, keepdims=True)
        return np.asarray(math.cos(math.pi / SIDES) * self.normals + math.sin(math.pi / SIDES) * aside)

    @property
    def lift(self) -> float:
        """Distance of a ray's start from its facet, in scene units: half of a facet's width."""
        return 0.5 * float(np.linalg.norm(self.corners[0, 0, 1] - self.corners[0, 0, 0]))


def half_width(positions: Doubles, meters_per_unit: float, *, is_cylindrical: bool = False) -> float:
    """Return half of a facet's width in scene units."""
    extent = float(np.ptp(positions, axis=0).max(initial=0.0))
    return max(HALF / meters_per_unit, (COARSEST_CYLINDER if is_cylindrical else COARSEST) * extent)


def clusters(positions: Doubles, extent: float) -> list[list[int]]:
    """Return the numbers of positions (N, 3) by cubes with this edge, which begin at the lowest corner of all."""
    found: dict[tuple[int, ...], list[int]] = {}
    for k, cell in enumerate(map(tuple, np.floor((positions - positions.min(axis=0)) / extent).tolist())):
        found.setdefault(cell, []).append(k)
    return list(found.values())


def groups_apart(positions: Doubles, least: float) -> list[list[int]]:
    """Return the numbers of positions (N, 3) in groups, within which any two are at least `least` apart."""
    groups: list[list[int]] = []
    cells: list[dict[tuple[int, ...], list[int]]] = []  # of each group, as wide as `least`
    steps = list(product((-1, 0, 1), repeat=3))
    for k, cell in enumerate(map(tuple, np.floor((positions - positions[0]) / least).astype(np.int64).tolist())):
        around = [tuple(c + s for c, s in zip(cell, step, strict=True)) for step in steps]
        number = next((n for n, taken in enumerate(cells) if _is_free(positions, k, around, taken, least)), len(groups))
        if number == len(groups):
            groups.append([])
            cells.append({})
        groups[number].append(k)
        cells[number].setdefault(cell, []).append(k)
    return groups


def _is_free(
    positions: Doubles, k: int, around: list[tuple[int, ...]], taken: dict[tuple[int, ...], list[int]], least: float
) -> bool:
    near = [other for cell in around for other in taken.get(cell, ())]
    return not near or bool((np.linalg.norm(positions[near] - positions[k], axis=1) >= least).all())


def facets_of(meters: Meters, half: float) -> Facets:
    """Return the facets of light meters, whose width is twice `half`: a plane's at its meter, a cylinder's stacked above it."""
    positions = meters.positions()
    origin = positions[0]
    directions = meters.directions()
    corners, normals = np.empty((len(positions), SIDES, 4, 3)), np.empty((len(positions), SIDES, 3))
    u, v = _across(directions)
    for k, meter in enumerate(meters.meters):
        middle = positions[k] - origin
        if meter.kind is MeterKind.CYLINDRICAL:
            # Each side has a facet of its own, which is seen from the front: close to the back of a facet that is far from the
            # origin, rounding hides which side a ray came from, and such hits are black.
            angles = 2 * np.pi * np.arange(SIDES) / SIDES
            out = np.cos(angles)[:, None] * u[k] + np.sin(angles)[:, None] * v[k]
            aside = np.cross(directions[k], out)
            heights = half + 2 * half * SLIM * (np.array(_ORDER) + 0.5)
            middles = middle + heights[:, None] * directions[k]
            corners[k] = _squares(middles, aside, SLIM * directions[k], half)
            normals[k] = out
        else:
            # Above the plane that the meter may lie on, by its own width.
            corners[k] = _squares(middle + 2 * half * directions[k], u[k], v[k], half)
            normals[k] = directions[k]
    return Facets(origin, corners, normals)


def _across(directions: Doubles) -> tuple[Doubles, Doubles]:
    """Return unit vectors (N, 3) such that u x v is each direction."""
    aside = np.where(np.abs(directions[:, :1]) < 0.5, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    u = np.cross(aside, directions)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(directions, u)


def _squares(middles: Doubles, u: Doubles, v: Doubles, half: float) -> Doubles:
    """Return corners (..., 4, 3), counter-clockwise as seen from u x v."""
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
    middles, u, v = np.broadcast_arrays(middles, u, v)
    return middles[..., None, :] + half * (signs[:, :1] * u[..., None, :] + signs[:, 1:] * v[..., None, :])


def with_facets(description: SceneDescription, facets: Facets) -> SceneDescription:
    """Return the scene with the facets as one mesh of a white Lambertian surface."""
    planes = np.arange(facets.corners.shape[0])
    alike = (facets.corners == facets.corners[:, :1]).all(axis=(1, 2, 3))  # all facets of a plane are one
    squares = np.concatenate([facets.corners[k, : 1 if alike[k] else SIDES] for k in planes])
    first = 4 * np.arange(len(squares))[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    mesh = Mesh(PATH, squares.reshape(-1, 3).astype(np.float32), triangles, None, None, len(description.surfaces))
    place = np.eye(4)
    place[:3, 3] = facets.origin
    return replace(
        description,
        shapes=(*description.shapes, mesh),
        surfaces=(*description.surfaces, Surface(PATH, lambert=True, diffuse_color=(1.0, 1.0, 1.0))),
        static=(*description.static, Placed(len(description.shapes), place)),
    )


def blocks_across(meters: int) -> tuple[int, int]:
    """Return the columns and rows of blocks in the picture of so many meters."""
    columns = math.ceil(math.sqrt(meters))
    return columns, math.ceil(meters / columns)


def camera_of(facets: Facets) -> tuple[Camera, tuple[int, int]]:
    """Return the camera of the facets and its picture's resolution; blocks without a meter repeat the last one's."""
    count = len(facets.corners)
    columns, rows = blocks_across(count)
    which = np.minimum(np.arange(columns * rows), count - 1)
    places = (facets.aims + facets.lift * facets.away)[which]
    table = DirectionTable(
        (
            -0.5 * PIXEL * BLOCK * columns,
            0.5 * PIXEL * BLOCK * columns,
            -0.5 * PIXEL * BLOCK * rows,
            0.5 * PIXEL * BLOCK * rows,
        ),
        _as_picture(-facets.away[which], columns, rows),
        _as_picture(places, columns, rows),
    )
    place = np.eye(4)
    place[:3, 3] = facets.origin
    camera = Camera(
        path="",
        world_from_camera=place,
        projection=Projection.PERSPECTIVE,
        window=table.window,
        clipping_range=(0.0, FARTHEST),
        distortion=Distortion(DistortionModel.RAYS, (), 180.0, table),
        pixels_follow_window=True,
    )
    return camera, (BLOCK * columns, BLOCK * rows)


def dicing_camera(facets: Facets, resolution: tuple[int, int]) -> Camera:
    """Return a pinhole camera with pixels of the same angle, for how finely shapes are diced."""
    x, y = (0.5 * PIXEL * side for side in resolution)
    place = np.eye(4)
    place[:3, 3] = facets.origin
    return Camera("", place, Projection.PERSPECTIVE, (-x, x, -y, y), (0.0, FARTHEST))


def _as_picture(values: Doubles, columns: int, rows: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """Return values (rows x columns, SIDES, 3) by pixel."""
    blocks = values.reshape(rows, columns, BLOCK, BLOCK, 3).transpose(0, 2, 1, 3, 4)
    return np.ascontiguousarray(blocks.reshape(rows * BLOCK, columns * BLOCK, 3), np.float32)


def by_meter(pixels: Doubles, count: int) -> Doubles:
    """Return values by pixel (H, W, ...) as (count, SIDES, ...)."""
    rows, columns = pixels.shape[0] // BLOCK, pixels.shape[1] // BLOCK
    blocks = pixels.reshape(rows, BLOCK, columns, BLOCK, *pixels.shape[2:]).swapaxes(1, 2)
    return np.asarray(blocks.reshape(rows * columns, SIDES, *pixels.shape[2:])[:count])
