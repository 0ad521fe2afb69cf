"""Construction of description.Mesh, in which only the length of normals and colours tells what they belong to.

Where two of the counts of triangles T, points N and corners 3T are equal, values are expanded to the unambiguous form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats, Ints
from ...description import Interpolation, Mesh, PointMotion
from ...description import Primvar as SeamPrimvar


@dataclass(frozen=True)
class Values:
    array: Floats  # (N, 3), (T, 3) or (3T, 3)
    per: Literal["point", "face", "corner"]


@dataclass(frozen=True, eq=False)
class PolygonMotion:
    """Points and normals at the times of a motion."""

    times: Doubles  # (S + 1,) fractions of the exposure's span
    points: Floats  # (S + 1, N, 3)
    normals: tuple[Values, ...] = ()  # S + 1 of the same kind, or none if they do not change

    def of_triangles(self, keep: npt.NDArray[np.bool_]) -> PolygonMotion:
        """Return the motion with normals of a subset of triangles; `keep` is a (T,) mask."""
        kept = (keep_triangles(values, keep) for values in self.normals)
        return replace(self, normals=tuple(values for values in kept if values is not None))

    def reordered(self, triangles: Ints) -> PolygonMotion:
        """Return the motion with points and normals per corner."""
        moved = (_to_corners(values, triangles) for values in self.normals)
        normals = tuple(values for values in moved if values is not None)
        return PolygonMotion(self.times, self.points[:, triangles.ravel()], normals)

    @property
    def at_seam(self) -> PointMotion:
        return PointMotion(self.times, self.points, np.stack([v.array for v in self.normals]) if self.normals else None)


def seam_mesh(
    path: str,
    points: Floats,
    triangles: Ints,
    normals: Values | None,
    colors: Values | None,
    surface: int | Ints,
    primvars: tuple[SeamPrimvar, ...] = (),
    motion: PolygonMotion | None = None,
) -> Mesh:
    if (normals or colors) and len(points) == 3 * len(triangles):
        order = triangles.ravel()
        points = points[order]
        primvars = tuple(replace(p, values=p.values[order]) if p.interpolation is Interpolation.POINT else p for p in primvars)
        normals, colors = _to_corners(normals, triangles), _to_corners(colors, triangles)
        motion = None if motion is None else motion.reordered(triangles)
        triangles = np.arange(len(order), dtype=np.int32).reshape(-1, 3)
    if colors and len(points) == len(triangles):
        colors = _to_corners(colors, triangles)
    array_of_normals = None if normals is None else normals.array
    array_of_colors = None if colors is None else colors.array
    at_seam = None if motion is None else motion.at_seam
    return Mesh(path, points, triangles, array_of_normals, array_of_colors, surface, primvars, motion=at_seam)


def keep_triangles(values: Values | None, keep: npt.NDArray[np.bool_]) -> Values | None:
    """Return the values of a subset of triangles; `keep` is a (T,) mask."""
    if values is None or values.per == "point":
        return values
    return Values(values.array[keep if values.per == "face" else np.repeat(keep, 3)], values.per)


def _to_corners(values: Values | None, triangles: Ints) -> Values | None:
    if values is None or values.per == "corner":
        return values
    array = values.array[triangles.ravel()] if values.per == "point" else np.repeat(values.array, 3, axis=0)
    return Values(array, "corner")
