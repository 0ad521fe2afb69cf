"""Adapters for UsdGeom's implicit shapes: exact spheres; other shapes as finely tessellated meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ....arrays import Floats
from ....description import Mesh, Shape, Sphere
from ...nurbs.spheres import inward_sphere
from ...paths.sizes import Call, growing_shape
from ...scene.bounds import NotBounded
from ...scene.context import Context
from ...scene.inheritance import ResolvedPrim
from ...shapes import tessellate
from ...shapes.seam_mesh import PolygonMotion, Values, seam_mesh
from ...shapes.surface_primvars import constant_primvars
from ...shapes.tessellate import Tessellated
from ...stage.values import When, number, token
from ..materials.surface import FALLBACK_COLOR, Appearance, appearance_of, is_hidden, make_surface, undisplaced


class _Shared(dict[Call, Tessellated | None]):
    """Tessellations by the call that makes them, since many prims are alike; None where sizes are not usable."""


def sphere(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    radius = abs(_number(prim, "radius", 1.0, ctx))
    appearance = _appearance(prim, ctx)
    if radius == 0 or is_hidden(appearance):
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

    path = growing_shape(prim, how, ctx)
    made = _made(how(ctx.when) if path is None else path.at(path.here), ctx)
    appearance = _appearance(prim, ctx)
    if made is None or is_hidden(appearance):
        return None
    motion = None if path is None else path.motion(made, ctx)
    if _is_left_handed(prim, ctx):
        made, motion = _flipped(made), motion and _flipped_motion(motion)
    if prim.type_name not in ("Cube", "Plane"):
        ctx.warn(
            "tessellated", prim.path, f"{prim.type_name} is tessellated with {tessellate.AROUND} segments around its axis."
        )
    normals = None if made.normals is None else Values(made.normals, "corner")
    surface = undisplaced(make_surface(appearance, lambda: prim.type_name != "Plane", prim.path, ctx), prim.path, ctx)
    primvars = constant_primvars(prim, (surface,), ctx)
    of_surface = ctx.surfaces.index_of(surface)
    mesh: Mesh = seam_mesh(prim.path, made.points, made.triangles, normals, None, of_surface, primvars, motion)
    return mesh


def _made(how: Call, ctx: Context) -> Tessellated | None:
    shared = ctx.kept.of(_Shared)
    if how not in shared:
        made = how[0](*how[1:])
        usable = bool(np.isfinite(made.points).all() and made.points.any())
        shared[how] = made if usable else None
    return shared[how]


def _is_left_handed(prim: ResolvedPrim, ctx: Context) -> bool:
    return "orientation" in prim.names and token(prim.prim, "orientation", ctx.when, "rightHanded") == "leftHanded"


def _flipped(made: Tessellated) -> Tessellated:
    """Return the shape with its faces reversed (UsdGeomGprim's leftHanded orientation)."""
    return Tessellated(made.points, made.triangles[:, [0, 2, 1]], None if made.normals is None else _turned(made.normals))


def _flipped_motion(motion: PolygonMotion) -> PolygonMotion:
    return replace(motion, normals=tuple(replace(values, array=_turned(values.array)) for values in motion.normals))


def _turned(normals: Floats) -> Floats:
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
        ctx.kept.of(NotBounded).add(prim.path)
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
