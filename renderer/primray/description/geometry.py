"""Shapes of a scene description: triangles, subdivision cages, NURBS patches with trim curves, spheres, curves, and the
primvars on them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Doubles, Floats, Ints, extremes

if TYPE_CHECKING:
    from .lighting import Light
    from .motion import PointMotion


class Interpolation(Enum):
    """Element that each row of a primvar's values belongs to."""

    CONSTANT = "constant"  # the whole shape: one row
    FACE = "face"  # a triangle of a Mesh, a face of a SubdivisionMesh, a curve of Curves
    POINT = "point"  # for Curves and a NurbsPatch: a control point
    CORNER = "corner"  # a triangle corner (3T rows) or a face corner; for Curves a segment end: n + 1 rows per curve
    VARYING = "varying"  # a point of a SubdivisionMesh, a crossing of a NurbsPatch's knots: linear over each face
    INSTANCE = "instance"  # an instance; in a Placement only


@dataclass(frozen=True, eq=False)
class Primvar:
    """Values that surface inputs read by name, one row per element, or per index if `indices` are given."""

    name: str
    interpolation: Interpolation
    values: Floats  # (K, C), C from 1 to 4
    indices: Ints | None = None  # CORNER on SubdivisionMesh only: equal indices are one point of the surface


@dataclass(frozen=True, slots=True)  # there may be millions
class Mesh:
    """Triangle mesh in object space; cross(p1 - p0, p2 - p0) points outwards (left-handed input is already flipped)."""

    path: str
    points: Floats  # (N, 3)
    triangles: Ints  # (T, 3), indices into points, all in range
    normals: Floats | None  # None: flat; (N, 3): per point; (3T, 3): per triangle corner. Unit length, outwards.
    colors: Floats | None  # None: the surface's own; (T, 3), (N, 3) or (3T, 3): multiplies diffuse_color (set to white)
    surface: int | Ints  # index into SceneDescription.surfaces, or (T,) of them
    primvars: tuple[Primvar, ...] = ()
    light: Light | None = None  # of type GEOMETRY, if the mesh is a light
    link_row: int = 0  # row in SceneDescription.linked
    motion: PointMotion | None = None

    def box(self) -> tuple[Doubles, Doubles]:
        """Return the low and high corner (3,) of what is drawn at the frame, in object space. Every shape has this method."""
        return _box_of(self.drawn_points())

    def drawn_points(self) -> Floats:
        """Return the points (K, 3) used by triangles, in object space."""
        return _used(self.points, self.triangles)


@dataclass(frozen=True, eq=False)
class SubdivisionMesh:
    """Subdivision cage, diced into a Mesh before rendering (tessellation/dice.py). Faces are wound counter-clockwise seen from
    outside (left-handed ones are flipped).

    Names and meanings are those of UsdGeomMesh: sharpness of 10 or more is infinite. Every index is in range.
    """

    path: str
    scheme: str  # "catmullClark", "loop" (triangles only), "bilinear"
    points: Floats  # (N, 3)
    face_counts: Ints  # (F,), at least 3 each
    face_points: Ints  # (sum of face_counts,)
    surface: int | Ints  # index into SceneDescription.surfaces, or (F,) of them, -1 for faces that are not drawn
    colors: Primvar | None = None  # displayColor if it varies: multiplies diffuse_color (set to white)
    holes: Ints | None = None  # (H,) faces that shape the surface but are not drawn
    crease_lengths: Ints | None = None
    crease_points: Ints | None = None
    crease_sharpnesses: Floats | None = None  # one per crease, or one per edge
    corner_points: Ints | None = None
    corner_sharpnesses: Floats | None = None
    interpolate_boundary: str = "edgeAndCorner"  # none, edgeOnly, edgeAndCorner
    face_varying_interpolation: str = "cornersPlus1"  # none, cornersOnly, cornersPlus1, cornersPlus2, boundaries, all
    triangle_rule: str = "catmullClark"  # triangleSubdivisionRule: catmullClark, smooth
    primvars: tuple[Primvar, ...] = ()
    light: Light | None = None
    link_row: int = 0
    motion: PointMotion | None = None  # of the cage's points

    def box(self) -> tuple[Doubles, Doubles]:
        """Return the box of the cage, which contains its limit surface."""
        return _box_of(self.drawn_points())

    def drawn_points(self) -> Floats:
        """Return the points (K, 3) used by faces, in object space; their convex hull contains the surface."""
        return _used(self.points, self.face_points)


@dataclass(frozen=True, eq=False)
class DisplacedMesh(SubdivisionMesh):
    """Cage, or polygons as a bilinear cage, whose diced points are displaced by a surface."""

    # CORNER primvar of the directions of displacement of polygons: 3 numbers, then 3 for each time of their motion if they
    # change. None: the normals of the diced surface.
    normals: Primvar | None = None
    reach: float = 0.0  # largest displacement of its points, as far as it is known before textures are read

    def drawn_points(self) -> Floats:
        """Return the points (K, 3), shifted by the reach along each axis, whose convex hull contains the displaced surface."""
        points = super().drawn_points()
        if self.reach == 0:
            return points
        ways = np.concatenate([np.eye(3, dtype=np.float32), -np.eye(3, dtype=np.float32)]) * np.float32(self.reach)
        return (points[None] + ways[:, None]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class NurbsPatch:
    """Rational B-spline surface, diced into a Mesh before rendering (tessellation/nurbs). Normals point along dP/du x dP/dv.

    Control points and POINT values are ordered with u varying fastest. FACE values belong to the segments between knots [order
    - 1, count] and VARYING values to their crossings, in the same order.
    """

    path: str
    points: Floats  # (N, 3) as authored, not multiplied by weights
    weights: Doubles | None  # (N,) positive; None: all 1
    u: Direction
    v: Direction
    surface: int
    loops: tuple[TrimLoop, ...] = ()  # trim loops: inside an odd number of them is drawn, or an even one if they are holes
    colors: Primvar | None = None  # displayColor if it varies, as in SubdivisionMesh
    primvars: tuple[Primvar, ...] = ()
    is_flipped: bool = False  # left-handed: its normals point the other way
    light: Light | None = None
    link_row: int = 0
    motion: PointMotion | None = None  # of the control points

    def box(self) -> tuple[Doubles, Doubles]:
        """Return the box of the control points, whose convex hull contains the surface."""
        return _box_of(self.points)

    def drawn_points(self) -> Floats:
        return self.points


@dataclass(frozen=True, slots=True)
class Sphere:
    """Exact sphere about the origin of object space."""

    path: str
    radius: float
    surface: int
    primvars: tuple[Primvar, ...] = ()  # CONSTANT only
    light: Light | None = None
    link_row: int = 0

    def box(self) -> tuple[Doubles, Doubles]:
        reach = abs(self.radius)
        return np.full(3, -reach), np.full(3, reach)


@dataclass(frozen=True, slots=True)
class Curves:
    """Tubes along cubic Bezier curves: disks perpendicular to the tangent, with a radius that is a cubic as well, closed by
    disks at both ends.

    A curve of n segments has 3 n + 1 control points, one after the other. Similarity transforms scale the radii; any other
    matrix makes tubes elliptic (core/single_precision.py).
    """

    path: str
    # (N, 4): x, y, z and radius. The radius along a segment is not negative; its two inner control values may be.
    controls: Floats
    segments: Ints  # (C,) number of segments of each curve, at least 1
    surface: int | Ints  # index into SceneDescription.surfaces, or one per segment, -1 for those not drawn
    closed: bool = False  # the last control point of each curve is its first
    joined: bool = True  # segments may meet at angles: part of a sphere fills the gap
    primvars: tuple[Primvar, ...] = ()
    light: Light | None = None
    link_row: int = 0
    motion: PointMotion | None = None  # of the control points, (S + 1, N, 4)

    def box(self) -> tuple[Doubles, Doubles]:
        """Return the box of the control points' spheres, which contains the tubes."""
        return _box_of_balls(self.controls)


@dataclass(frozen=True, eq=False, kw_only=True)
class Ribbons:
    """Flat curves, diced into a Mesh before rendering (tessellation/ribbons.py): at each point of a curve laid out as in
    Curves, half the width extends to both sides, perpendicular to the tangent and the interpolated normal."""

    path: str
    controls: Floats  # (N, 4): x, y, z and half the width, as the radii of Curves
    normals: Floats  # (N, 3) control values, of any length
    segments: Ints  # (C,) number of segments of each curve, at least 1
    surface: int | Ints  # index into SceneDescription.surfaces, or one per segment, -1 for those not drawn
    primvars: tuple[Primvar, ...] = ()
    light: Light | None = None
    link_row: int = 0
    motion: PointMotion | None = None  # of controls and normals side by side, (S + 1, N, 7)

    def box(self) -> tuple[Doubles, Doubles]:
        """Return the box of the control points' spheres, which contains the ribbons."""
        return _box_of_balls(self.controls)


def _used(points: Floats, indices: Ints) -> Floats:
    is_used = np.zeros(len(points), bool)
    is_used[indices] = True
    return points if is_used.all() else points[is_used]


_BALLS = 1 << 14  # converted to double at a time: millions do not fit into the CPU's cache


def _box_of_balls(balls: Floats) -> tuple[Doubles, Doubles]:
    """Return the box of spheres (N, 4) given by centre and radius."""
    low, high = [], []
    for first in range(0, len(balls), _BALLS):
        x, y, z, radii = balls[first : first + _BALLS].T.astype(np.float64)
        centres = np.stack([x, y, z])
        low.append((centres - radii).min(axis=1))
        high.append((centres + radii).max(axis=1))
    return np.min(low, axis=0), np.max(high, axis=0)


def _box_of(points: Floats) -> tuple[Doubles, Doubles]:
    low, high = extremes(points)
    return low.astype(np.float64), high.astype(np.float64)


Shape = Mesh | SubdivisionMesh | DisplacedMesh | NurbsPatch | Sphere | Curves | Ribbons


@dataclass(frozen=True, eq=False)
class Direction:
    """B-spline basis of `order` (at least 2: degree + 1) over `count` control points."""

    count: int
    order: int
    knots: Doubles  # (count + order,), not decreasing
    low: float  # start of the drawn part of [knots[order - 1], knots[count]]
    high: float


@dataclass(frozen=True, eq=False)
class TrimCurve:
    """Curve in the parameters of a patch."""

    basis: Direction
    points: Doubles  # (count, 3), homogeneous: (u w, v w, w)


# Loop of curves, each of which begins where the last one ends; its end is joined to its beginning.
TrimLoop = tuple[TrimCurve, ...]


FEWEST_PAIRED_TRIANGLES = 512  # triangles; fewer do not gain from pairing


def is_paired(triangles: Ints) -> bool:
    """Return whether triangles (T, 3) are enough to be worth it and all in pairs."""
    if len(triangles) < FEWEST_PAIRED_TRIANGLES or len(triangles) % 2:
        return False
    first, second = triangles[::2], triangles[1::2]
    return bool((first[:, 0] == second[:, 0]).all() and (first[:, 1] == second[:, 2]).all())
