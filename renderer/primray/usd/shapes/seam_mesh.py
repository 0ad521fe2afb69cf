"""The last step to description.Mesh, whose normals and colours say by their length alone what they belong to.

Where two of T triangles, N points and 3T corners are equal numbers, values move to the reading that cannot be mistaken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from ...arrays import Floats, Ints
from ...description import Interpolation, Mesh, Primvar


@dataclass(frozen=True)
class Values:
    array: Floats  # (N, 3), (T, 3) or (3T, 3)
    per: Literal["point", "face", "corner"]


def seam_mesh(
    path: str,
    points: Floats,
    triangles: Ints,
    normals: Values | None,
    colors: Values | None,
    surface: int | Ints,
    primvars: tuple[Primvar, ...] = (),
) -> Mesh:
    if (normals or colors) and len(points) == 3 * len(triangles):
        order = triangles.ravel()
        points = points[order]
        primvars = tuple(replace(p, values=p.values[order]) if p.interpolation is Interpolation.POINT else p for p in primvars)
        normals, colors = _to_corners(normals, triangles), _to_corners(colors, triangles)
        triangles = np.arange(len(order), dtype=np.int32).reshape(-1, 3)
    if colors and len(points) == len(triangles):
        colors = _to_corners(colors, triangles)
    array_of_normals = None if normals is None else normals.array
    array_of_colors = None if colors is None else colors.array
    return Mesh(path, points, triangles, array_of_normals, array_of_colors, surface, primvars)


def keep_triangles(values: Values | None, keep: npt.NDArray[np.bool_]) -> Values | None:
    """The values of some triangles only; `keep` is (T,)."""
    if values is None or values.per == "point":
        return values
    return Values(values.array[keep if values.per == "face" else np.repeat(keep, 3)], values.per)


def _to_corners(values: Values | None, triangles: Ints) -> Values | None:
    if values is None or values.per == "corner":
        return values
    array = values.array[triangles.ravel()] if values.per == "point" else np.repeat(values.array, 3, axis=0)
    return Values(array, "corner")
