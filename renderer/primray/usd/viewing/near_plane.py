"""What a camera's near plane cuts open: found by a few rays from the eye to the plane against what is in their way.

Sets of many things are not looked at: the check has to cost less than a hundredth of a translation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import Camera, Mesh, Placed, Projection, Shape, Sphere, SubdivisionMesh
from ..resolving.context import Context

MOST_THINGS = 4096
MOST_TRIANGLES = 1 << 22  # of one mesh
ACROSS, DOWN = 24, 18  # rays
LEAST_SHARE = 0.01  # of the rays
LOOKED_AT = 512  # triangles within the rays' box that rays are traced against; of more, their centres tell as much


def note_near_plane(camera: Camera, shapes: Sequence[Shape], static: Sequence[Placed], ctx: Context) -> None:
    near = camera.clipping_range[0]
    is_plain = camera.path and camera.projection is Projection.PERSPECTIVE and camera.distortion is None
    if not is_plain or not near > 0 or len(static) > MOST_THINGS:
        return
    eye, ends = camera.world_from_camera[:3, 3], _ends(camera, near)
    low, high = np.minimum(eye, ends.min(axis=0)), np.maximum(eye, ends.max(axis=0))
    nearest = np.full(len(ends), np.inf)
    paths = []
    for placed in static:
        shape = shapes[placed.shape]
        if not isinstance(shape, Mesh | SubdivisionMesh | Sphere):
            continue
        own = np.linalg.inv(placed.matrix) if abs(np.linalg.det(placed.matrix[:3, :3])) > 0 else None
        if own is None or (isinstance(shape, Sphere) and not _may_meet(shape.box(), own, low, high)):
            continue
        start, way = own[:3, :3] @ eye + own[:3, 3], (ends - eye) @ own[:3, :3].T
        found = _sphere_hits(shape, start, way) if isinstance(shape, Sphere) else _mesh_hits(shape, start, way)
        if (found < 1).any():
            paths.append(shape.path)
        nearest = np.minimum(nearest, found)
    share = float(np.mean(nearest < 1))
    if share < LEAST_SHARE:
        return
    distance = near * float(nearest.min())
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


def _may_meet(box: tuple[Doubles, Doubles], own: Doubles, low: Doubles, high: Doubles) -> bool:
    """Whether the box meets that of the rays, seen in the shape's own space."""
    center, half = (low + high) / 2, (high - low) / 2
    middle, reach = own[:3, :3] @ center + own[:3, 3], np.abs(own[:3, :3]) @ half
    return bool((box[0] <= middle + reach).all() and (box[1] >= middle - reach).all())


def _sphere_hits(shape: Sphere, start: Doubles, way: Doubles) -> Doubles:
    """(N,) fractions of the way at which rays enter or leave it first; inf where they do not."""
    a, b = (way * way).sum(axis=1), way @ start
    inside = b * b - a * (start @ start - shape.radius**2)
    root = np.sqrt(np.maximum(inside, 0))
    first, second = (-b - root) / a, (-b + root) / a
    found = np.where(first > 0, first, second)
    return np.where((inside > 0) & (found > 0), found, np.inf)


def _mesh_hits(shape: Mesh | SubdivisionMesh, start: Doubles, way: Doubles) -> Doubles:
    """As _sphere_hits; a cage is taken for its surface. What is not between the eye and the plane costs a product a point."""
    found = np.full(len(way), np.inf)
    normal = np.linalg.lstsq(way, np.ones(len(way)), rcond=None)[0]  # of the plane: 1 on it, 0 at the eye
    depth = shape.points @ normal.astype(np.float32) - np.float32(normal @ start)
    if not len(depth) or depth.min() > 1 or depth.max() < 0:
        return found
    triangles = shape.triangles if isinstance(shape, Mesh) else _fans(shape)
    if len(triangles) > MOST_TRIANGLES:
        return found
    of_corners = depth[triangles]
    triangles = triangles[(of_corners.min(axis=1) <= 1) & (of_corners.max(axis=1) >= 0)]
    corners = np.asarray(shape.points, np.float64)[triangles] - start
    low, high = np.minimum(way.min(axis=0), 0), np.maximum(way.max(axis=0), 0)
    corners = corners[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)]
    if len(corners) > LOOKED_AT:
        return _splatted(corners.mean(axis=1), normal, way)
    for k in range(0, len(corners), 64):
        found = np.minimum(found, _nearest(corners[k : k + 64], way))
    return found


def _splatted(centers: Doubles, normal: Doubles, way: Doubles) -> Doubles:
    """The same for many small triangles: by which rays their centres (K, 3) are nearest to."""
    depth = centers @ normal
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
