"""What a camera's near plane cuts open: found by a few rays from the eye to the plane against what is in their way.

Instances and sets of many things are not looked at: the check has to cost less than a hundredth of a translation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import Camera, Mesh, Placed, Projection, Shape, Sphere, SubdivisionMesh
from ..resolving.context import Context

MOST_THINGS = 4096
MOST_TRIANGLES = 1 << 22  # of one mesh
SMALL = 512  # points of a mesh
ACROSS, DOWN = 24, 18  # rays
LEAST_SHARE = 0.01  # of the rays
LOOKED_AT = 512  # triangles within the rays' box that rays are traced against; of more, their centres tell as much


def note_near_plane(camera: Camera, shapes: Sequence[Shape], static: Sequence[Placed], ctx: Context) -> None:
    near = camera.clipping_range[0]
    is_plain = camera.path and camera.projection is Projection.PERSPECTIVE and camera.distortion is None
    if not is_plain or not near > 0 or len(static) > MOST_THINGS:
        return
    eye, ends = camera.world_from_camera[:3, 3], _ends(camera, near)
    along = -camera.world_from_camera[:3, 2] / near  # its product with what is seen from the eye is 0 there, 1 on the plane
    nearest = np.full(len(ends), np.inf)
    paths: list[str] = []
    for k, depth in _between(shapes, static, eye, along):
        placed, shape = static[k], shapes[static[k].shape]
        rotation = placed.matrix[:3, :3]
        if not isinstance(shape, Mesh | SubdivisionMesh | Sphere) or abs(np.linalg.det(rotation)) == 0:
            continue
        own = np.asarray(np.linalg.inv(rotation), np.float64)
        start, way = own @ (eye - placed.matrix[:3, 3]), (ends - eye) @ own.T
        found = _sphere_hits(shape, start, way) if isinstance(shape, Sphere) else _mesh_hits(shape, start, way, depth)
        if (found < 1).any():
            paths.append(shape.path)
        nearest = np.minimum(nearest, found)
    share = float(np.mean(nearest < 1))
    if share < LEAST_SHARE:
        return
    distance, paths = near * float(nearest.min()), sorted(paths)
    message = (
        f"The near plane at {near:g} cuts off what is in {share:.0%} of the picture, the nearest of it at {distance:.3g}: "
        f"{', '.join(paths[:3])}{' and others' if len(paths) > 3 else ''}. If it is not to be cut open, author a clippingRange "
        f"that begins at {0.5 * distance:.2g}."
    )
    ctx.warn("near-plane", camera.path, message, "clippingRange")


def _ends(camera: Camera, near: float) -> Doubles:
    """(N, 3) world: points of the near plane that are seen."""
    left, right, bottom, top = camera.window
    x = left + (np.arange(ACROSS) + 0.5) / ACROSS * (right - left)
    y = bottom + (np.arange(DOWN) + 0.5) / DOWN * (top - bottom)
    across, up = np.meshgrid(x, y)
    local = near * np.stack([across.ravel(), up.ravel(), np.full(across.size, -1.0)], axis=1)
    found: Doubles = local @ camera.world_from_camera[:3, :3].T + camera.world_from_camera[:3, 3]
    return found


def _between(shapes: Sequence[Shape], static: Sequence[Placed], eye: Doubles, along: Doubles) -> Iterator[tuple[int, Doubles]]:
    """Which of the placed shapes have something between the eye (depth 0) and the plane (depth 1), and the vector (3,) in
    their own space whose product with a point, less that of the eye, is its depth. Small meshes are looked at together."""
    if not static:
        return
    matrices = np.stack([placed.matrix for placed in static])
    vectors, at = along @ matrices[:, :3, :3], (matrices[:, :3, 3] - eye) @ along
    few: list[int] = []
    for k, placed in enumerate(static):
        shape = shapes[placed.shape]
        if isinstance(shape, Sphere):
            reach = abs(shape.radius) * float(np.linalg.norm(vectors[k]))
            if at[k] - reach < 1 and at[k] + reach > 0:
                yield k, vectors[k]
        elif isinstance(shape, Mesh | SubdivisionMesh):
            if 0 < len(shape.points) <= SMALL:
                few.append(k)
            elif len(shape.points):
                depth = shape.points @ vectors[k].astype(np.float32)
                if depth.min() + at[k] < 1 and depth.max() + at[k] > 0:
                    yield k, vectors[k]
    if few:
        points = [shapes[static[k].shape].points for k in few]  # type: ignore[union-attr]
        counts = np.array([len(p) for p in points])
        depth = (np.concatenate(points) * np.repeat(vectors[few], counts, axis=0)).sum(axis=1) + np.repeat(at[few], counts)
        starts = np.cumsum(counts) - counts
        meets = (np.minimum.reduceat(depth, starts) < 1) & (np.maximum.reduceat(depth, starts) > 0)
        for k in np.array(few)[meets].tolist():
            yield k, vectors[k]


def _sphere_hits(shape: Sphere, start: Doubles, way: Doubles) -> Doubles:
    """(N,) fractions of the way at which rays enter or leave it first; inf where they do not."""
    a, b = (way * way).sum(axis=1), way @ start
    inside = b * b - a * (start @ start - shape.radius**2)
    root = np.sqrt(np.maximum(inside, 0))
    first, second = (-b - root) / a, (-b + root) / a
    found = np.where(first > 0, first, second)
    return np.where((inside > 0) & (found > 0), found, np.inf)


def _mesh_hits(shape: Mesh | SubdivisionMesh, start: Doubles, way: Doubles, along: Doubles) -> Doubles:
    """As _sphere_hits; a cage is taken for its surface."""
    found = np.full(len(way), np.inf)
    triangles = shape.triangles if isinstance(shape, Mesh) else _fans(shape)
    if len(triangles) > MOST_TRIANGLES:
        return found
    of_corners = ((shape.points - start) @ along)[triangles]
    triangles = triangles[(of_corners.min(axis=1) <= 1) & (of_corners.max(axis=1) >= 0)]
    corners = np.asarray(shape.points, np.float64)[triangles] - start
    low, high = np.minimum(way.min(axis=0), 0), np.maximum(way.max(axis=0), 0)
    corners = corners[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)]
    if len(corners) > LOOKED_AT:
        return _splatted(corners.mean(axis=1), along, way)
    for k in range(0, len(corners), 64):
        found = np.minimum(found, _nearest(corners[k : k + 64], way))
    return found


def _splatted(centers: Doubles, along: Doubles, way: Doubles) -> Doubles:
    """The same for many small triangles: by which rays their centres (K, 3) are nearest to."""
    depth = centers @ along
    centers, depth = centers[(depth > 0) & (depth < 1)], depth[(depth > 0) & (depth < 1)]
    first, across, down = way[0], (way[ACROSS - 1] - way[0]) / (ACROSS - 1), (way[-1] - way[ACROSS - 1]) / (DOWN - 1)
    at = np.rint((centers / depth[:, None] - first) @ np.linalg.pinv(np.stack([across, down])))
    seen = ((at >= 0) & (at < (ACROSS, DOWN))).all(axis=1)
    found = np.full(len(way), np.inf)
    np.minimum.at(found, (at[seen] @ (1, ACROSS)).astype(np.intp), depth[seen])
    return found


def _nearest(corners: Doubles, way: Doubles) -> Doubles:
    """(N,) fractions of the way at which rays from the origin meet the first of (K, 3, 3) triangles: Moeller, Trumbore 1997."""
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


def _fans(cage: SubdivisionMesh) -> npt.NDArray[np.intp]:
    """(T, 3) corners of its faces' fans."""
    counts = np.asarray(cage.face_counts, np.int64)
    starts = np.cumsum(counts) - counts
    face = np.repeat(np.arange(len(counts)), np.maximum(counts - 2, 0))
    k = np.arange(len(face)) - np.repeat(
        np.cumsum(np.maximum(counts - 2, 0)) - np.maximum(counts - 2, 0), np.maximum(counts - 2, 0)
    )
    corners = np.asarray(cage.face_points)
    return np.stack([corners[starts[face]], corners[starts[face] + k + 1], corners[starts[face] + k + 2]], axis=1)
