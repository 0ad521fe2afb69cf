"""Geometry that emits: with LightAPI or MeshLightAPI, or named by a GeometryLight (UsdLux, deprecated).

It emits as light:materialSyncMode says (UsdLux LightAPI). The geometry that a GeometryLight names gets its properties and
LightAPI in a copy of the stage.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from ...description import Shape, Surface
from ...diagnostics import Diagnostics
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..scene.schemas import LEFT_OUT
from ..stage.edits import check_reach, editable
from ..stage.open import scratch_copy
from ..stage.reads import property_names, purpose_of, schemas_applied, targets
from ..stage.values import When, is_hidden, token
from .authored import AuthoredLight
from .light import geometry_light
from .light_links import Links
from .light_settings import read_light_settings

GLOW_TINTS_LIGHT, INDEPENDENT, NO_MATERIAL = "materialGlowTintsLight", "independent", "noMaterialResponse"
# noMaterialResponse: "as if there is no Material bound at all, i.e. there is no diffuse, specular, or transmissive response."
EMISSION_ONLY = Surface("", lambert=True, diffuse_color=(0.0, 0.0, 0.0), emissive_color=(1.0, 1.0, 1.0))


def sync_mode(prim: ResolvedPrim, ctx: Context) -> str:
    """Return the mode. The others need "geometry that has a bound Material": without one it is noMaterialResponse."""
    if prim.material is None and not any(subset.material is not None for subset in prim.subsets):
        return NO_MATERIAL
    mode = token(prim.prim, "light:materialSyncMode", ctx.when, NO_MATERIAL)  # the schemas' own defaults come with them
    if mode in (GLOW_TINTS_LIGHT, INDEPENDENT, NO_MATERIAL):
        return mode
    message = f"light:materialSyncMode = {mode!r} is unknown: {NO_MATERIAL} is used."
    ctx.warn("light-input", prim.path, message, "light:materialSyncMode")
    return NO_MATERIAL


def without_material(prim: ResolvedPrim, ctx: Context) -> ResolvedPrim:
    """Return the prim without its materials if they have no response; they hide no faces then, either."""
    return replace(prim, material=None, subsets=()) if sync_mode(prim, ctx) == NO_MATERIAL else prim


def with_light(shape: Shape, prim: ResolvedPrim, ctx: Context, links: Links | None) -> Shape:
    """Return the shape with the prim's light."""
    light = read_light_settings(prim, ctx, links).applied(geometry_light(AuthoredLight(prim, ctx)))
    if not light.visible_to_camera:
        ctx.warn("light-input", prim.path, "A geometry light cannot be hidden from the camera: it is visible.")
    mode = sync_mode(prim, ctx)
    if mode == NO_MATERIAL:
        lamp = ctx.surfaces.index_of(EMISSION_ONLY)
        light = replace(light, own_color=True, shows_own=True)
        without_colors: dict[str, Any] = {"colors": None} if hasattr(shape, "colors") else {}
        return replace(shape, surface=lamp, primvars=(), light=light, **without_colors)
    if mode == GLOW_TINTS_LIGHT and not any(_is_emissive(s) for s in _surfaces(shape, ctx)):
        message = "materialGlowTintsLight multiplies the light by its material's emission, which is 0: it emits nothing."
        ctx.warn("light-dark", prim.path, message, "light:materialSyncMode")
    return replace(shape, light=replace(light, own_color=mode == INDEPENDENT))


def _surfaces(shape: Shape, ctx: Context) -> list[Surface]:
    all_surfaces = list(ctx.surfaces)
    return [all_surfaces[i] for i in np.unique(np.atleast_1d(np.asarray(shape.surface))).tolist() if i >= 0]


def _is_emissive(surface: Surface) -> bool:
    return any(surface.emissive_color) or any(name == "emissive_color" for name, _ in surface.inputs)


# Properties of the light prim itself, which its geometry does not get.
_OWN_PROPERTIES = ("xformOp", "visibility", "purpose", "geometry", "light:shaderId", "extent")


def with_geometry_lights(
    stage: Usd.Stage, lights: Sequence[Usd.Prim], purposes: Container[str], when: When, diagnostics: Diagnostics
) -> Usd.Stage:
    """Return a copy of the stage in which the geometry that GeometryLights name emits in their place.

    The GeometryLights are left out, but not their children. A GeometryLight that names no geometry stays and is reported like
    any unsupported light. `purposes` are those that are rendered.
    """
    made = scratch_copy(stage)
    lit: dict[Sdf.Path, Sdf.Path] = {}  # geometry, and which light it gives
    done: list[Sdf.Path] = []
    hidden = {light.GetPath(): _is_hidden(light, purposes, when) for light in lights}
    with Usd.EditContext(made, made.GetSessionLayer()):
        for path in hidden:
            light = editable(made, path)
            shapes = [target for target in targets(light, "geometry") if made.GetPrimAtPath(target)]
            for shape in [] if hidden[path] else shapes:  # by paths: ending an instance invalidates prims of others
                if lit.setdefault(shape, path) != path:
                    message = f"{shape} already emits as the geometry of {lit[shape]}: it does not emit this light as well."
                    diagnostics.add("light-input", str(path), message, "geometry")
                elif made.GetPrimAtPath(shape).IsA(UsdGeom.Gprim):
                    given = editable(made, shape)
                    _copy_light(made.GetPrimAtPath(path), given)
                else:
                    message = f"geometry names {shape}, which is not geometry and cannot emit."
                    diagnostics.add("light-input", str(path), message, "geometry")
            if shapes:
                done.append(path)
        for path in done:  # after all geometry is lit: other lights may reference this one
            made.GetPrimAtPath(path).CreateAttribute(LEFT_OUT, Sdf.ValueTypeNames.Bool).Set(True)
    check_reach(made)
    return made


def _is_hidden(light: Usd.Prim, purposes: Container[str], when: When) -> bool:
    return is_hidden(light, when) or purpose_of(light) not in purposes or LEFT_OUT in property_names(light)


def _copy_light(light: Usd.Prim, shape: Usd.Prim) -> None:
    for schema in ("LightAPI", *schemas_applied(light)):
        if schema not in schemas_applied(shape):
            shape.AddAppliedSchema(schema)
    for name in property_names(light):
        if not name.startswith(_OWN_PROPERTIES):
            light.GetProperty(name).FlattenTo(shape, name)
