"""Dicing of Ribbons to a Mesh: a strip of quads along each curve, with edges as long as the camera's view allows.

Adjacent quads share vertices, so a strip has no cracks, whatever the numbers of quads in its segments.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from ..description import Interpolation, Mesh, PointMotion, Primvar, Ribbons
from .footprint import Footprint

Ints = npt.NDArray[np.integer[Any]]

MAX_QUADS = 1024  # per segment
STRAIGHT = 1e-5  # largest distance of a straight segment from its chord, relative to its size
TINY = 1e-12
BEND = 1e-3  # smallest change of side direction between segments for which their edges are mitred
LEAST_COSINE = 0.5  # limits mitres to twice the width


def first_controls(ribbons: Ribbons) -> Ints:
    """Return the first control point (S,) of each segment."""
    count = int(ribbons.segments.sum())
    return 3 * np.arange(count) + np.repeat(np.arange(len(ribbons.segments)), ribbons.segments)


def quads_of(ribbons: Ribbons, footprint: Footprint, pixels: float) -> Ints:
    """Return the number of quads (S,) of each segment: one if it is straight and does not twist."""
    first = first_controls(ribbons)
    four = np.arange(4)
    points = ribbons.controls[first[:, None] + four].astype(np.float64)
    normals = ribbons.normals[first[:, None] + four].astype(np.float64)
    length = np.linalg.norm(np.diff(points[:, :, :3], axis=1), axis=2).sum(axis=1)
    covered = footprint.density * length
    camera = footprint.projected
    for view in footprint.views:
        there = points[:, :, :3] @ view[:, :3].T + view[:, 3]
        across = np.linalg.norm(np.diff(there, axis=1), axis=2).sum(axis=1)
        depth = np.linalg.norm(there, axis=2).min(axis=1)
        nearness = 1.0 if camera.orthographic else 1.0 / np.maximum(depth, np.maximum(across, 1e-30) / MAX_QUADS)
        covered = np.maximum(covered, across * camera.pixels_per_unit * nearness)
    quads = np.clip(np.ceil(covered / pixels), 1, MAX_QUADS).astype(np.int64)
    thirds = np.array([0.0, 1 / 3, 2 / 3, 1.0])
    even = points[:, :1] + thirds[:, None] * (points[:, 3:] - points[:, :1])
    size = np.maximum(np.abs(points[:, :, :3] - points[:, :1, :3]).max(axis=(1, 2)), TINY)
    unit = normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), TINY)
    is_flat = (np.abs(points - even).max(axis=(1, 2)) <= STRAIGHT * size) & (
        np.abs(unit - unit[:, :1]).max(axis=(1, 2)) <= STRAIGHT
    )
    return np.where(is_flat, 1, quads)


@dataclass(frozen=True)
class _Rows:
    """Points on curves with two vertices each: the segment that each is on, and its parameter."""

    segment: Ints  # (R,)
    u: Doubles  # (R,)
    first: Ints  # (R,) first control point of the segment
    curve: Ints  # (R,)
    quad_row: Ints  # (Q,) row at which each quad begins; it ends at the next
    quad_segment: Ints  # (Q,)

    def bezier(self, values: npt.NDArray[np.floating]) -> Doubles:
        """Return values (R, k) interpolated from those at control points."""
        u, v = self.u[:, None], 1 - self.u[:, None]
        p = [values[self.first + k].astype(np.float64) for k in range(4)]
        return np.asarray(p[0] * v**3 + p[1] * (3 * u * v * v) + p[2] * (3 * u * u * v) + p[3] * u**3)

    def derivative(self, values: npt.NDArray[np.floating]) -> Doubles:
        u, v = self.u[:, None], 1 - self.u[:, None]
        p = [values[self.first + k].astype(np.float64) for k in range(4)]
        return np.asarray(3 * ((p[1] - p[0]) * v * v + (p[2] - p[1]) * (2 * u * v) + (p[3] - p[2]) * u * u))


def _rows(ribbons: Ribbons, quads: Ints) -> _Rows:
    """Return the rows: the start of each quad in every segment, and a last row for each curve."""
    run = np.repeat(np.arange(len(ribbons.segments)), ribbons.segments)
    is_last = np.append(run[1:] != run[:-1], True)
    rows = quads + is_last
    segment = np.repeat(np.arange(len(quads)), rows)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(rows) - rows, rows)
    quad_row = np.flatnonzero(within < quads[segment])
    u = within / quads[segment]
    return _Rows(
        segment=segment,
        u=u,
        first=first_controls(ribbons)[segment],
        curve=run[segment],
        quad_row=quad_row,
        quad_segment=segment[quad_row],
    )


def strip(ribbons: Ribbons, quads: Ints) -> Mesh:
    rows = _rows(ribbons, quads)
    worn = ribbons.surface
    drawn = np.ones(len(rows.quad_row), bool) if isinstance(worn, int) else np.asarray(worn)[rows.quad_segment] >= 0
    quad_row, quad_segment = rows.quad_row[drawn], rows.quad_segment[drawn]
    left, right = 2 * quad_row, 2 * quad_row + 1
    # Counter-clockwise about the normal: from the left edge to the right one, then along the curve.
    triangles = np.stack([left, right + 2, left + 2, left, right, right + 2], axis=1).reshape(-1, 3).astype(np.int32)
    points, normals = _edges(rows, ribbons.controls, ribbons.normals)
    per_triangle = np.repeat(quad_segment, 2)
    motion = None
    if ribbons.motion is not None:
        steps = [_edges(rows, step[:, :4], step[:, 4:]) for step in ribbons.motion.points]
        motion = PointMotion(ribbons.motion.times, np.stack([p for p, _ in steps]), np.stack([n for _, n in steps]))
    if len(points) == 3 * len(triangles):  # lengths must be unambiguous (description.Mesh)
        normals = normals[triangles.ravel()]
        motion = motion and replace(motion, normals=motion.normals[:, triangles.ravel()])  # type: ignore[index]
    return Mesh(
        path=ribbons.path,
        points=points,
        triangles=triangles,
        normals=normals,
        colors=None,
        surface=worn if isinstance(worn, int) else np.asarray(worn)[per_triangle].astype(np.int32),
        primvars=tuple(_primvar(p, ribbons, rows, rows.curve[np.repeat(quad_row, 2)]) for p in ribbons.primvars),
        light=ribbons.light,
        link_row=ribbons.link_row,
        motion=motion,
    )


def _edges(rows: _Rows, controls: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return points and unit normals (2 R, 3) of the strips' vertices, left and right of each row."""
    here, along = rows.bezier(controls), rows.derivative(controls)
    asked = rows.bezier(normals)
    tangent = along[:, :3]
    side = _across(tangent, asked)
    out = side * _mitred(rows, controls, asked, side)
    left, right = here[:, :3] - here[:, 3:] * out, here[:, :3] + here[:, 3:] * out
    # Derivative of the surface along the curve, at its left and right edges.
    turning = _turning(rows, side)
    found = []
    for sign in (-1.0, 1.0):
        down = tangent + sign * (along[:, 3:] * side + here[:, 3:] * turning)
        found.append(_unit(np.cross(side, down), _unit(np.cross(side, tangent), asked)))
    points = np.stack([left, right], axis=1).reshape(-1, 3).astype(np.float32)
    return points, np.stack(found, axis=1).reshape(-1, 3).astype(np.float32)


def _mitred(rows: _Rows, controls: Floats, normals: Doubles, side: Doubles) -> Doubles:
    """Return the factors (R, 1) by which mitred edges are longer where two segments meet at an angle; rotates `side` to the
    bisector there."""
    starts = np.flatnonzero((rows.u == 0) & (np.append(-1, rows.curve[:-1]) == rows.curve))
    at = rows.first[starts]
    before = controls[at, :3].astype(np.float64) - controls[at - 1, :3]
    other = _across(before, normals[starts])
    turned = _unit(other + side[starts], side[starts])
    longer = np.ones((len(side), 1))
    cosine = np.einsum("rc,rc->r", turned, side[starts])
    bends = (np.linalg.norm(other - side[starts], axis=1) > BEND) & before.any(axis=1)
    longer[starts[bends], 0] = 1 / np.maximum(cosine[bends], LEAST_COSINE)
    side[starts[bends]] = turned[bends]
    return longer


def _across(tangent: Doubles, normals: Doubles) -> Doubles:
    """Return unit vectors to the right, tangent x normal; where these are parallel, any vector perpendicular to the tangent."""
    size = np.linalg.norm(tangent, axis=1, keepdims=True) * np.linalg.norm(normals, axis=1, keepdims=True)
    side = np.cross(tangent, normals)
    length = np.linalg.norm(side, axis=1, keepdims=True)
    axis = np.eye(3)[np.abs(tangent).argmin(axis=1)]
    other = _unit(np.cross(tangent, axis), np.broadcast_to(np.array([1.0, 0, 0]), side.shape))
    return np.where(length > 1e-6 * size, side / np.maximum(length, 1e-300), other)


def _turning(rows: _Rows, side: Doubles) -> Doubles:
    """Return the derivative of `side` by u, from differences to the next row of the same segment, or the previous one."""
    same = np.append(rows.segment[1:] == rows.segment[:-1], False)
    step = np.append(np.diff(rows.u), 1.0)
    change = np.append(np.diff(side, axis=0), np.zeros((1, 3)), axis=0)
    forward = np.where(same[:, None], change / np.where(same, step, 1.0)[:, None], 0.0)
    backward = np.concatenate([np.zeros((1, 3)), forward[:-1]])
    before = np.concatenate([[False], same[:-1]])
    weight = same.astype(np.float64) + before
    return np.asarray((forward + backward) / np.maximum(weight, 1.0)[:, None])


def _unit(v: Doubles, otherwise: Doubles) -> Doubles:
    length = np.linalg.norm(v, axis=1, keepdims=True)
    return np.where(length > 0, v / np.where(length > 0, length, 1.0), otherwise)


def _primvar(primvar: Primvar, ribbons: Ribbons, rows: _Rows, curve_of: Ints) -> Primvar:
    kind = primvar.interpolation
    if kind is Interpolation.CONSTANT:
        return primvar
    if kind is Interpolation.FACE:
        return replace(primvar, values=primvar.values[curve_of])
    if kind is Interpolation.POINT:
        values = rows.bezier(primvar.values)
    else:
        end = rows.segment + rows.curve
        first, last = primvar.values[end].astype(np.float64), primvar.values[end + 1]
        values = first + (last - first) * rows.u[:, None]
    return Primvar(primvar.name, Interpolation.POINT, np.repeat(values, 2, axis=0).astype(np.float32))
