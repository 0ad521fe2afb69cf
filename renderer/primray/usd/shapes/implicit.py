"""Adapters for UsdGeom's implicit shapes: exact spheres, and finely tessellated meshes for the others; both with animated
sizes.

Shapes with animated sizes are tessellated at each sampled time; animated spheres are scaled by their transform. Left-handed
spheres that transmit light become NURBS patches, since exact spheres always face outwards.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...arrays import Doubles, Floats
from ...description import Direction, Mesh, NurbsPatch, Primvar, Shape, Sphere
from ..materials.appearance import FALLBACK_COLOR, Appearance, appearance_of, is_cut_out, make_surface, undisplaced
from ..mesh.polygons import PolygonMotion, Values, make_mesh
from ..motion.attributes import bend_times, is_animated
from ..motion.levels import Local
from ..motion.points import point_steps
from ..motion.sample_times import fractions
from ..primvars.surface_primvars import constant_primvars
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import When, number, read, token
from . import tessellate
from .tessellate import Tessellated, cap_rings, capsule

Call = tuple[Any, ...]  # a function of tessellate.py and its arguments: many shapes are alike
SIZES = ("size", "width", "length", "radius", "height", "radiusBottom", "radiusTop")
SMALLEST_SIZE = 1e-12  # replaces 0, so that flat shapes have the same triangles at all times


@dataclass(frozen=True, eq=False)
class SizePath:
    """Motion of an implicit shape. Offsets from the frame include motion:blurScale."""

    prim: ResolvedPrim
    at: Callable[[float], Call]
    times: tuple[float, ...]
    here: float  # offset of the frame, or of the instant of a still
    blur_scale: float

    def motion(self, frame: Tessellated, ctx: Context) -> PolygonMotion | None:
        """Return the motion of the tessellation `frame`; None if it does not change while the shutter is open."""
        if not ctx.timing.is_open:
            return None
        known: dict[float, Tessellated] = {}

        def at(fraction: float) -> Tessellated:
            if fraction not in known:
                how = self.at(self.blur_scale * ctx.timing.offset(fraction))
                known[fraction] = how[0](*how[1:])
            return known[fraction]

        bent = fractions(self.times, ctx.timing.span, self.blur_scale)
        looked_at = [at(time) for time in (0.0, *(time for time in bent if 0.0 < time < 1.0), 0.5, 1.0)]
        if not all(_has_same_topology(frame, then) for then in looked_at):
            ctx.warn("motion", self.prim.path, "Its size is not blurred: the topology changes, as when a size passes 0.")
            return None
        count = len(frame.points)
        times = point_steps(lambda fraction: _points_and_normals(at(fraction)), count, bent, self.prim.path, ctx, curved=True)
        if times is None:
            return None
        found = [at(time) for time in times]
        normals = [made.normals for made in found if made.normals is not None]
        turning = bool(normals) and not all(np.array_equal(normals[0], then) for then in normals)
        points = np.stack([made.points for made in found])
        return PolygonMotion(np.array(times), points, tuple(Values(then, "corner") for then in normals) if turning else ())


def animated_shape(prim: ResolvedPrim, how: Callable[[When], Call], ctx: Context) -> SizePath | None:
    """Return the shape's motion, or None if its sizes do not change; the axis is that of the frame. `how` returns the
    tessellation at a time."""
    if ctx.timing.is_frame:
        return None
    sizes = [attribute for name in SIZES if (attribute := prim.prim.GetAttribute(name))]
    moving = [attribute for attribute in sizes if is_animated(attribute, ctx.when, ctx.timing)]
    if not moving:
        return None
    frame = how(ctx.when)
    rings = cap_rings(*frame[1:4]) if frame[0] is capsule and ctx.timing.is_open else ()

    def at(offset: float) -> Call:
        then = how(ctx.when.after(offset))
        return (*(_not_flat(was if isinstance(was, str) else now) for was, now in zip(frame, then, strict=True)), *rings)

    scale = prim.inherited.blur_scale
    here = 0.0 if ctx.timing.is_open else scale * ctx.timing.opens
    return SizePath(prim, at, tuple(bend_times(moving, ctx.when, ctx.timing)), here, scale)


def _not_flat(given: Any) -> Any:
    return SMALLEST_SIZE if isinstance(given, float) and given == 0.0 else given


def _has_same_topology(a: Tessellated, b: Tessellated) -> bool:
    return len(a.points) == len(b.points) and np.array_equal(a.triangles, b.triangles) and bool(np.isfinite(b.points).all())


def _points_and_normals(made: Tessellated) -> np.ndarray[Any, np.dtype[np.float32]]:
    return made.points if made.normals is None else np.concatenate([made.points, made.normals])


def sphere(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    radius = abs(_number(prim, "radius", 1.0, ctx))
    appearance = _appearance(prim, ctx)
    if radius == 0 or is_cut_out(appearance):
        return None
    surface = undisplaced(make_surface(appearance, lambda: True, prim.path, ctx), prim.path, ctx)
    of_surface, primvars = ctx.surfaces.index_of(surface), constant_primvars(prim, (surface,), ctx)
    if surface.transmits and not surface.thin and _is_left_handed(prim, ctx):  # elsewhere orientation is not visible
        return inward_sphere(prim.path, radius, of_surface, primvars)
    return Sphere(prim.path, radius, of_surface, primvars)


def tessellated(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    """Return a tessellated implicit shape (cube, plane, cone, cylinder or capsule), or None if it is hidden or its sizes are
    not usable."""

    def how(when: When) -> Call:
        return _TESSELLATE[prim.type_name](prim, replace(ctx, when=when))

    path = animated_shape(prim, how, ctx)
    made = _tessellation(how(ctx.when) if path is None else path.at(path.here), ctx)
    appearance = _appearance(prim, ctx)
    if made is None or is_cut_out(appearance):
        return None
    motion = None if path is None else path.motion(made, ctx)
    if _is_left_handed(prim, ctx):
        made, motion = _reversed(made), motion and _flipped_motion(motion)
    if prim.type_name not in ("Cube", "Plane"):
        ctx.warn(
            "tessellated", prim.path, f"{prim.type_name} is tessellated with {tessellate.AROUND} segments around its axis."
        )
    normals = None if made.normals is None else Values(made.normals, "corner")
    surface = undisplaced(make_surface(appearance, lambda: prim.type_name != "Plane", prim.path, ctx), prim.path, ctx)
    primvars = constant_primvars(prim, (surface,), ctx)
    of_surface = ctx.surfaces.index_of(surface)
    mesh: Mesh = make_mesh(prim.path, made.points, made.triangles, normals, None, of_surface, primvars, motion)
    return mesh


def _tessellation(how: Call, ctx: Context) -> Tessellated | None:
    shared = ctx.caches.tessellations
    if how not in shared:
        made = how[0](*how[1:])
        usable = bool(np.isfinite(made.points).all() and made.points.any())
        shared[how] = made if usable else None
    return shared[how]


def _is_left_handed(prim: ResolvedPrim, ctx: Context) -> bool:
    return "orientation" in prim.names and token(prim.prim, "orientation", ctx.when, "rightHanded") == "leftHanded"


def _reversed(made: Tessellated) -> Tessellated:
    """Return the shape with its faces reversed (UsdGeomGprim's leftHanded orientation)."""
    return Tessellated(
        made.points, made.triangles[:, [0, 2, 1]], None if made.normals is None else _reversed_normals(made.normals)
    )


def _flipped_motion(motion: PolygonMotion) -> PolygonMotion:
    return replace(motion, normals=tuple(replace(values, array=_reversed_normals(values.array)) for values in motion.normals))


def _reversed_normals(normals: Floats) -> Floats:
    """Return normals (3T, 3) for triangles with reversed winding."""
    return np.asarray(-normals.reshape(-1, 3, 3)[:, [0, 2, 1]].reshape(-1, 3))


def _appearance(prim: ResolvedPrim, ctx: Context) -> Appearance:
    appearance = appearance_of(prim, prim.material, ctx)
    if appearance.varying_color:
        message = f"primvars:displayColor is ignored: it varies, which is not supported for {prim.type_name}."
        ctx.warn("invalid-primvar", prim.path, message, "primvars:displayColor")
        appearance = replace(appearance, color=FALLBACK_COLOR, varying_color=False)
    return appearance


def _cube(prim: ResolvedPrim, ctx: Context) -> Call:
    return tessellate.cube, abs(_number(prim, "size", 2.0, ctx))


def _plane(prim: ResolvedPrim, ctx: Context) -> Call:
    return tessellate.plane, _number(prim, "width", 2.0, ctx), _number(prim, "length", 2.0, ctx), _axis(prim, ctx)


def _cone(prim: ResolvedPrim, ctx: Context) -> Call:
    return tessellate.cone, abs(_number(prim, "radius", 1.0, ctx)), _number(prim, "height", 2.0, ctx), _axis(prim, ctx)


def _cylinder(prim: ResolvedPrim, ctx: Context) -> Call:
    return tessellate.cylinder, *_radii(prim, 1.0, ctx), _number(prim, "height", 2.0, ctx), _axis(prim, ctx)


def _capsule(prim: ResolvedPrim, ctx: Context) -> Call:
    bottom, top = _radii(prim, 0.5, ctx)
    if bottom != top and "extent" not in prim.names:
        ctx.findings.unbounded_shapes.add(prim.path)
    return tessellate.capsule, bottom, top, _number(prim, "height", 1.0, ctx), _axis(prim, ctx)


def _radii(prim: ResolvedPrim, default: float, ctx: Context) -> tuple[float, float]:
    if prim.type_name.endswith("_1"):
        return abs(_number(prim, "radiusBottom", default, ctx)), abs(_number(prim, "radiusTop", default, ctx))
    radius = abs(_number(prim, "radius", default, ctx))
    return radius, radius


def _axis(prim: ResolvedPrim, ctx: Context) -> str:
    axis = token(prim.prim, "axis", ctx.when, "Z") if "axis" in prim.names else "Z"
    return axis if axis in ("X", "Y", "Z") else "Z"


def _number(prim: ResolvedPrim, name: str, default: float, ctx: Context) -> float:
    return number(prim.prim, name, ctx.when, default, ctx.diagnostics)  # unauthored ones, too: value clips may have it


_TESSELLATE: dict[str, Callable[[ResolvedPrim, Context], Call]] = {
    "Cube": _cube,
    "Plane": _plane,
    "Cone": _cone,
    "Cylinder": _cylinder,
    "Cylinder_1": _cylinder,
    "Capsule": _capsule,
    "Capsule_1": _capsule,
}


def animated_sphere(prim: ResolvedPrim, ctx: Context) -> tuple[Local, list[float]] | None:
    """Return the scale over time as a transform, 1 at the frame, and the offsets at which it may bend; None if the radius does
    not change."""
    if ctx.timing.is_frame:
        return None
    attribute, when = prim.prim.GetAttribute("radius"), ctx.when
    if not is_animated(attribute, when, ctx.timing):
        return None
    whole = _finite_number(read(prim.prim, "radius", when))
    if not whole:
        return None

    def local(offset: float) -> Doubles:
        scale = abs(_finite_number(read(prim.prim, "radius", when.after(offset))) / whole)
        return np.diag((scale, scale, scale, 1.0))

    return local, bend_times([attribute], when, ctx.timing)


def _finite_number(found: object) -> float:
    return float(found) if isinstance(found, int | float) and math.isfinite(found) else 0.0


_MIDDLE_WEIGHT = 0.5**0.5  # weight of a quarter circle's middle point (Piegl and Tiller, "The NURBS Book", 7.3)
_CIRCLE = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0))
_ARC = ((0, -1), (1, -1), (1, 0), (1, 1), (0, 1))  # (radius, height) from pole to pole
_AROUND = Direction(9, 3, np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], np.float64), 0.0, 4.0)
_UP = Direction(5, 3, np.array([0, 0, 0, 1, 1, 2, 2, 2], np.float64), 0.0, 2.0)


def inward_sphere(path: str, radius: float, surface: int, primvars: tuple[Primvar, ...]) -> NurbsPatch:
    """Return a sphere about the origin whose normals point inwards."""
    points = radius * np.array([(x * r, y * r, z) for r, z in _ARC for x, y in _CIRCLE])
    weights = np.outer([1, _MIDDLE_WEIGHT, 1, _MIDDLE_WEIGHT, 1], [1, _MIDDLE_WEIGHT] * 4 + [1]).ravel()
    return NurbsPatch(
        path=path,
        points=points.astype(np.float32),
        weights=weights,
        u=_AROUND,
        v=_UP,
        surface=surface,
        primvars=primvars,
        is_flipped=True,
    )
