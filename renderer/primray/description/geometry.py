"""The seam's shapes: triangles, subdivision cages, spheres, curves, and the primvars on them. Part of description.py."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..arrays import Doubles, Floats, Ints
from .lighting import Light
from .motion import PointMotion
from .nurbs import Direction, TrimLoop


class Interpolation(Enum):
    """What each row of a primvar's values belongs to."""

    CONSTANT = "constant"  # the whole shape: one row
    FACE = "face"  # a triangle of a Mesh, a face of a SubdivisionMesh, a curve of Curves
    POINT = "point"  # of Curves and a NurbsPatch: a control point
    CORNER = "corner"  # of a triangle (3T rows) or of a face; of Curves an end of a segment: n + 1 rows a curve
    VARYING = "varying"  # a point of a SubdivisionMesh, a crossing of a NurbsPatch's knots: linear over each face between
    INSTANCE = "instance"  # Placement only


@dataclass(frozen=True, eq=False)
class Primvar:
    """Values that surfaces' inputs read by name; `indices`, where given, say which row each element has."""

    name: str
    interpolation: Interpolation
    values: Floats  # (K, C), C from 1 to 4
    indices: Ints | None = None  # SubdivisionMesh's CORNER only, where equal indices mean one point of the surface


@dataclass(frozen=True, slots=True)  # there may be millions
class Mesh:
    """Triangles in object space; cross(p1 - p0, p2 - p0) points outwards (left-handed input is already flipped)."""

    path: str
    points: Floats  # (N, 3)
    triangles: Ints  # (T, 3), indices into points, all in range
    normals: Floats | None  # None: flat; (N, 3): per point; (3T, 3): per triangle corner. Unit length, outwards.
    colors: Floats | None  # None: the surface's own; (T, 3), (N, 3) or (3T, 3): multiplies diffuse_color (made white)
    surface: int | Ints  # index into SceneDescription.surfaces, or (T,) of them
    primvars: tuple[Primvar, ...] = ()
    light: Light | None = None  # of type GEOMETRY: what it gives as a light
    link_row: int = 0  # of SceneDescription.linked
    motion: PointMotion | None = None

    def box(self) -> tuple[Doubles, Doubles]:
        """Low and high corner (3,) of what is drawn at the frame, in object space. Every shape has one."""
        return _box_of(self.drawn_points())

    def drawn_points(self) -> Floats:
        """(K, 3) those that triangles have, in object space."""
        return _used(self.points, self.triangles)


@dataclass(frozen=True, eq=False)
class SubdivisionMesh:
    """A cage, diced into a Mesh before rendering (dice.py). Faces run around their outside (left-handed ones are flipped).

    Names and meanings as in UsdGeomMesh: sharpness 10 and more is infinite. Every index is in range.
    """

    path: str
    scheme: str  # "catmullClark", "loop" (triangles only), "bilinear"
    points: Floats  # (N, 3)
    face_counts: Ints  # (F,), 3 or more each
    face_points: Ints  # (sum of face_counts,)
    surface: int | Ints  # index into SceneDescription.surfaces, or (F,) of them, -1 for faces that are not drawn
    colors: Primvar | None = None  # displayColor where it varies: multiplies diffuse_color (made white)
    holes: Ints | None = None  # faces that shape the surface but are not drawn
    crease_lengths: Ints | None = None
    crease_points: Ints | None = None
    crease_sharpnesses: Floats | None = None  # one a crease, or one an edge
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
        """Of the cage, which holds its surface."""
        return _box_of(self.drawn_points())

    def drawn_points(self) -> Floats:
        """(K, 3) those that faces have, in object space: their hull holds the surface."""
        return _used(self.points, self.face_points)


@dataclass(frozen=True, eq=False)
class DisplacedMesh(SubdivisionMesh):
    """A cage, or polygons as a bilinear one, of which some surface moves the points once they are diced."""

    # CORNER: along which polygons are moved, 3 numbers; then 3 for each time of their motion, if they turn. None: its own.
    normals: Primvar | None = None
    reach: float = 0.0  # how far its points move at most, as far as that is known before anything is read

    def drawn_points(self) -> Floats:
        """And how far they may go, along each axis."""
        points = super().drawn_points()
        if self.reach == 0:
            return points
        ways = np.concatenate([np.eye(3, dtype=np.float32), -np.eye(3, dtype=np.float32)]) * np.float32(self.reach)
        return (points[None] + ways[:, None]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class NurbsPatch:
    """A rational B-spline surface, diced into a Mesh before rendering (refine/nurbs). Its normals point along dP/du x dP/dv.

    Control points and values of POINT run along u first. The segments between knots [order - 1, count] have the values of
    FACE, their crossings those of VARYING, likewise along u first.
    """

    path: str
    points: Floats  # (N, 3) as authored, not multiplied by weights
    weights: Doubles | None  # (N,) positive; None: all 1
    u: Direction
    v: Direction
    surface: int
    loops: tuple[TrimLoop, ...] = ()  # what they enclose is drawn: an odd number of them, or an even one if they are holes
    colors: Primvar | None = None  # displayColor where it varies, as SubdivisionMesh has it
    primvars: tuple[Primvar, ...] = ()
    is_flipped: bool = False  # its normals point the other way: it is left-handed
    light: Light | None = None
    link_row: int = 0
    motion: PointMotion | None = None  # of the control points

    def box(self) -> tuple[Doubles, Doubles]:
        """Of the control points, whose hull holds the surface."""
        return _box_of(self.points)

    def drawn_points(self) -> Floats:
        return self.points


@dataclass(frozen=True, slots=True)
class Sphere:
    """An exact sphere about the object-space origin."""

    path: str
    radius: float
    surface: int
    primvars: tuple[Primvar, ...] = ()  # constant ones
    light: Light | None = None
    link_row: int = 0

    def box(self) -> tuple[Doubles, Doubles]:
        reach = abs(self.radius)
        return np.full(3, -reach), np.full(3, reach)


@dataclass(frozen=True, slots=True)
class Curves:
    """Tubes along cubic Bezier curves: discs across the tangent, whose radius is a cubic likewise, with discs at their ends.

    A curve of n segments has 3 n + 1 control points, one after the other. Radii go with a similarity; any other matrix makes
    tubes elliptic (refine/stretched_curves.py).
    """

    path: str
    # (N, 4): x, y, z and radius. The radius along a segment is not negative; its two inner control values may be.
    controls: Floats
    segments: Ints  # (C,) of each curve, at least 1
    surface: int | Ints  # index into SceneDescription.surfaces, or one for each segment of all, -1 for those not drawn
    closed: bool = False  # the last control point of each curve is its first
    joined: bool = True  # segments may meet at angles: part of a ball fills the gap
    primvars: tuple[Primvar, ...] = ()
    light: Light | None = None
    link_row: int = 0
    motion: PointMotion | None = None  # of the control points, (S + 1, N, 4)

    def box(self) -> tuple[Doubles, Doubles]:
        """Of the control points' balls, which holds the tubes."""
        return _box_of_balls(self.controls)


@dataclass(frozen=True, eq=False)
class Ribbons:
    """Flat curves, diced into a Mesh before rendering (refine/ribbons.py): from each point of a curve, laid out as Curves, half
    the width to both sides, across the tangent and the interpolated normal."""

    path: str
    controls: Floats  # (N, 4): x, y, z and half the width, as the radii of Curves
    normals: Floats  # (N, 3) control values, of any length
    segments: Ints  # (C,) of each curve, at least 1
    surface: int | Ints  # index into SceneDescription.surfaces, or one for each segment of all, -1 for those not drawn
    primvars: tuple[Primvar, ...] = ()
    light: Light | None = None
    link_row: int = 0
    motion: PointMotion | None = None  # of controls and normals side by side, (S + 1, N, 7)

    def box(self) -> tuple[Doubles, Doubles]:
        """Of the control points' balls."""
        return _box_of_balls(self.controls)


def _used(points: Floats, indices: Ints) -> Floats:
    is_used = np.zeros(len(points), bool)
    is_used[indices] = True
    return points if is_used.all() else points[is_used]


def _box_of_balls(balls: Floats) -> tuple[Doubles, Doubles]:
    """Of (N, 4): centres and radii."""
    centres, radii = balls[:, :3].astype(np.float64), balls[:, 3:]
    return (centres - radii).min(axis=0), (centres + radii).max(axis=0)


def _box_of(points: Floats) -> tuple[Doubles, Doubles]:
    low, high = points.min(axis=0), points.max(axis=0)
    return low.astype(np.float64), high.astype(np.float64)


Shape = Mesh | SubdivisionMesh | DisplacedMesh | NurbsPatch | Sphere | Curves | Ribbons
