"""Check for geometry that the camera's near plane (camera.py reads it) clips: a few rays are traced from the eye to the plane.

Instances and scenes of many objects are not tested, as the check has to cost less than a hundredth of a translation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import Camera, Mesh, Placed, Projection, Shape, Sphere, SubdivisionMesh
from ..scene.context import Context

MOST_THINGS = 4096
MOST_TRIANGLES = 1 << 22  # of one mesh
SMALL = 512  # points of a mesh
ACROSS, DOWN = 24, 18  # rays
CORNERS = [0, ACROSS - 1, ACROSS * DOWN - 1, ACROSS * (DOWN - 1)]  # indices of the ray grid's corners, in order around it
LEAST_SHARE = 0.01  # share of the rays that must hit
DEPTH = 4  # index of the depth among the planes of the ray pyramid
NO_TRIANGLES = np.empty((0, 3), np.int64)
LOOKED_AT = 512  # rays are traced against this many triangles; of more, centres are projected to the rays


def report_clipped_geometry(camera: Camera, shapes: Sequence[Shape], static: Sequence[Placed], ctx: Context) -> None:
    """Report geometry in front of the near plane that would be visible."""
    near = camera.clipping_range[0]
    is_plain = camera.path and camera.projection is Projection.PERSPECTIVE and camera.distortion is None
    if not is_plain or not near > 0 or len(static) > MOST_THINGS:
        return
    eye, ends = camera.world_from_camera[:3, 3], _ends(camera, near)
    sides = _sides(camera, near, ends - eye)
    nearest = np.full(len(ends), np.inf)
    paths: list[str] = []
    for k in _between(shapes, static, eye, sides):
        shape = shapes[static[k].shape]
        found = _hits(shape, static[k].matrix, eye, ends - eye, sides)
        if (found < 1).any():
            paths.append(shape.path)
        nearest = np.minimum(nearest, found)
    share = float(np.mean(nearest < 1))
    if share < LEAST_SHARE:
        return
    distance, paths = near * float(nearest.min()), sorted(paths)
    message = (
        f"The near plane at {near:g} clips geometry in {share:.0%} of the picture, the nearest at {distance:.3g}: "
        f"{', '.join(paths[:3])}{' and others' if len(paths) > 3 else ''}. If this is not intended, author a clippingRange "
        f"that begins at {0.5 * distance:.2g}."
    )
    ctx.warn("near-plane", camera.path, message, "clippingRange")


def _ends(camera: Camera, near: float) -> Doubles:
    """Return points of the near plane in world space, (N, 3), on a grid over the window."""
    left, right, bottom, top = camera.window
    x = left + (np.arange(ACROSS) + 0.5) / ACROSS * (right - left)
    y = bottom + (np.arange(DOWN) + 0.5) / DOWN * (top - bottom)
    across, up = np.meshgrid(x, y)
    local = near * np.stack([across.ravel(), up.ravel(), np.full(across.size, -1.0)], axis=1)
    found: Doubles = local @ camera.world_from_camera[:3, :3].T + camera.world_from_camera[:3, 3]
    return found


def _sides(camera: Camera, near: float, way: Doubles) -> Doubles:
    """Return the planes (5, 3) of the pyramid of rays, in world space relative to the eye.

    Dot products of the first four with points inside are not negative; the last gives the depth, 0 at the eye and 1 at the
    near plane.
    """
    middle = way.mean(axis=0)
    edges = middle + 1.001 * (way[CORNERS] - middle)  # a little wider, for rounding
    normals = np.cross(edges, np.roll(edges, -1, axis=0))
    normals *= np.sign(normals @ middle)[:, None]
    return np.vstack([normals, -camera.world_from_camera[:3, 2] / near])


def _between(shapes: Sequence[Shape], static: Sequence[Placed], eye: Doubles, sides: Doubles) -> Iterator[int]:
    """Yield the indices of placed shapes that may extend between the eye (depth 0) and the plane (depth 1).

    Small meshes are tested together.
    """
    if not static:
        return
    matrices = np.stack([placed.matrix for placed in static])
    vectors, at = sides[DEPTH] @ matrices[:, :3, :3], (matrices[:, :3, 3] - eye) @ sides[DEPTH]
    few: list[int] = []
    for k, placed in enumerate(static):
        shape = shapes[placed.shape]
        if isinstance(shape, Sphere):
            reach = abs(shape.radius) * float(np.linalg.norm(vectors[k]))
            if at[k] - reach < 1 and at[k] + reach > 0:
                yield k
        elif isinstance(shape, Mesh | SubdivisionMesh):
            if 0 < len(shape.points) <= SMALL:
                few.append(k)
            elif len(shape.points):
                yield k
    if few:
        points = [shapes[static[k].shape].points for k in few]  # type: ignore[union-attr]
        counts = np.array([len(p) for p in points])
        depth = np.einsum("nk,nk->n", np.concatenate(points), np.repeat(vectors[few].astype(points[0].dtype), counts, axis=0))
        depth += np.repeat(at[few], counts)
        starts = np.cumsum(counts) - counts
        is_between = (np.minimum.reduceat(depth, starts) < 1) & (np.maximum.reduceat(depth, starts) > 0)
        yield from np.array(few)[is_between].tolist()


def _hits(shape: Shape, matrix: Doubles, eye: Doubles, way: Doubles, sides: Doubles) -> Doubles:
    """Return fractions (N,) of the distance to the plane at which rays first hit a placed shape; inf if they miss."""
    rotation, eye = matrix[:3, :3], eye - matrix[:3, 3]
    triangles = NO_TRIANGLES
    if isinstance(shape, Mesh | SubdivisionMesh):
        triangles = _within(shape, sides @ rotation, sides @ eye)
    if not (isinstance(shape, Sphere) or len(triangles)) or abs(np.linalg.det(rotation)) == 0:
        return np.full(len(way), np.inf)
    own = np.asarray(np.linalg.inv(rotation), np.float64)
    start, way = own @ eye, way @ own.T
    if isinstance(shape, Sphere):
        return _sphere_hits(shape, start, way)
    assert isinstance(shape, Mesh | SubdivisionMesh)
    return _triangle_hits(np.asarray(shape.points, np.float64)[triangles] - start, way, sides[DEPTH] @ rotation)


def _within(shape: Mesh | SubdivisionMesh, sides: Doubles, of_eye: Doubles) -> npt.NDArray[np.int64]:
    """Return the triangles (T, 3) of which no side of the pyramid has all corners beyond it (outcodes, Cohen and Sutherland).

    A cage is taken for its surface. `sides` are in the shape's space, `of_eye` (5,) are their products with the eye.
    """
    codes = np.zeros(len(shape.points), np.uint8)
    for k in (DEPTH, 0, 1, 2, 3):  # most shapes are rejected by the first
        distances = shape.points @ sides[k].astype(shape.points.dtype)
        at_eye = float(of_eye[k])  # a Python float does not promote the arrays to double
        low, high = float(distances.min()), float(distances.max())
        if high < at_eye or (k == DEPTH and low > at_eye + 1):
            return NO_TRIANGLES
        codes |= (distances < at_eye).view(np.uint8) * np.uint8(1 << k)
        if k == DEPTH:
            codes |= (distances > at_eye + 1).view(np.uint8) * np.uint8(1 << 5)
    if isinstance(shape, SubdivisionMesh):
        return _fans_within(shape, codes)
    if len(shape.triangles) > MOST_TRIANGLES:
        return NO_TRIANGLES
    of_corners = codes.take(shape.triangles)
    found: npt.NDArray[np.int64] = shape.triangles[(of_corners[:, 0] & of_corners[:, 1] & of_corners[:, 2]) == 0]
    return found


def _fans_within(cage: SubdivisionMesh, codes: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Return the fans (T, 3) of the faces of which no side has all corners beyond it; `codes` are its points' outcodes."""
    counts, corners = np.asarray(cage.face_counts, np.int64), np.asarray(cage.face_points)
    counts = counts[counts > 0]
    if not len(counts) or len(corners) > 3 * MOST_TRIANGLES:
        return NO_TRIANGLES
    starts = np.cumsum(counts) - counts
    faces = np.flatnonzero(np.bitwise_and.reduceat(codes.take(corners), starts) == 0)
    fans = np.maximum(counts[faces] - 2, 0)
    first = np.repeat(starts[faces], fans)
    k = np.arange(len(first)) - np.repeat(np.cumsum(fans) - fans, fans)
    found: npt.NDArray[np.int64] = np.stack([corners[first], corners[first + k + 1], corners[first + k + 2]], axis=1)
    return found


def _sphere_hits(shape: Sphere, start: Doubles, way: Doubles) -> Doubles:
    """Return fractions (N,) of the distance at which rays first enter or leave the sphere; inf if they miss."""
    a, b = (way * way).sum(axis=1), way @ start
    inside = b * b - a * (start @ start - shape.radius**2)
    root = np.sqrt(np.maximum(inside, 0))
    first, second = (-b - root) / a, (-b + root) / a
    found = np.where(first > 0, first, second)
    return np.where((inside > 0) & (found > 0), found, np.inf)


def _triangle_hits(corners: Doubles, way: Doubles, along: Doubles) -> Doubles:
    """Return fractions (N,) of the distance at which rays from the origin first hit triangles (T, 3, 3); inf if they miss."""
    found = np.full(len(way), np.inf)
    corners = corners[_splits_pyramid(corners, way)]
    if not len(corners):
        return found
    low, high = np.minimum(way.min(axis=0), 0), np.maximum(way.max(axis=0), 0)
    corners = corners[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)]
    if len(corners) > LOOKED_AT:
        return _splatted(corners.mean(axis=1), along, way)
    for k in range(0, len(corners), 64):
        found = np.minimum(found, _nearest(corners[k : k + 64], way))
    return found


def _splits_pyramid(corners: Doubles, way: Doubles) -> npt.NDArray[np.bool_]:
    """Return whether the eye and the corners of the rays' grid are on different sides of each triangle's plane."""
    a = corners[:, 0]
    normals = np.cross(corners[:, 1] - a, corners[:, 2] - a)
    of_plane = np.einsum("nk,nk->n", normals, a)
    heights = normals @ (1.001 * way[CORNERS]).T
    low, high = np.minimum(heights.min(axis=1), 0), np.maximum(heights.max(axis=1), 0)
    found: npt.NDArray[np.bool_] = (low <= of_plane) & (of_plane <= high)
    return found


def _splatted(centers: Doubles, along: Doubles, way: Doubles) -> Doubles:
    """Return hit fractions (N,) for many small triangles: each centre (K, 3) counts for the nearest ray."""
    depth = centers @ along
    centers, depth = centers[(depth > 0) & (depth < 1)], depth[(depth > 0) & (depth < 1)]
    first, across, down = way[0], (way[ACROSS - 1] - way[0]) / (ACROSS - 1), (way[-1] - way[ACROSS - 1]) / (DOWN - 1)
    at = np.rint((centers / depth[:, None] - first) @ np.linalg.pinv(np.stack([across, down])))
    seen = ((at >= 0) & (at < (ACROSS, DOWN))).all(axis=1)
    found = np.full(len(way), np.inf)
    np.minimum.at(found, (at[seen] @ (1, ACROSS)).astype(np.intp), depth[seen])
    return found


def _nearest(corners: Doubles, way: Doubles) -> Doubles:
    """Return hit fractions (N,) of rays from the origin with triangles (K, 3, 3): Moeller and Trumbore 1997."""
    a = corners[:, 0]
    side, other = corners[:, 1] - a, corners[:, 2] - a
    p = np.cross(way[:, None], other[None])  # (N, K, 3)
    q = np.cross(-a, side)
    det = (p * side).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = -(p * a).sum(axis=2) / det
        v = way @ q.T / det
        t = (q * other).sum(axis=1) / det
        is_hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    found: Doubles = np.where(is_hit, t, np.inf).min(axis=1)
    return found
