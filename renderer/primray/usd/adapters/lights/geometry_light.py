"""Geometry with LightAPI or MeshLightAPI, which emits as light:materialSyncMode says (UsdLux LightAPI)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ....description import Shape, Surface
from ...lights.light_links import Links
from ...resolving.context import Context
from ...resolving.read import token
from ...resolving.resolve import ResolvedPrim
from .light import geometry_light
from .light_rules import rules_of

GLOW, INDEPENDENT, NO_MATERIAL = "materialGlowTintsLight", "independent", "noMaterialResponse"
# noMaterialResponse: "as if there is no Material bound at all, i.e. there is no diffuse, specular, or transmissive response."
LAMP = Surface("", lambert=True, diffuse_color=(0.0, 0.0, 0.0), emissive_color=(1.0, 1.0, 1.0))


def sync_mode(prim: ResolvedPrim, ctx: Context) -> str:
    """Return the mode. The others need "geometry that has a bound Material": without one it is noMaterialResponse."""
    if prim.material is None and not any(subset.material is not None for subset in prim.subsets):
        return NO_MATERIAL
    mode = token(prim.prim, "light:materialSyncMode", ctx.when, NO_MATERIAL)  # the schemas' own defaults come with them
    if mode in (GLOW, INDEPENDENT, NO_MATERIAL):
        return mode
    message = f"light:materialSyncMode = {mode!r} is not one of {GLOW}, {INDEPENDENT}, {NO_MATERIAL}: {NO_MATERIAL} is used."
    ctx.warn("light-input", prim.path, message, "light:materialSyncMode")
    return NO_MATERIAL


def without_material(prim: ResolvedPrim, ctx: Context) -> ResolvedPrim:
    """Return the prim without its materials if they have no response; they hide no faces then, either."""
    return replace(prim, material=None, subsets=()) if sync_mode(prim, ctx) == NO_MATERIAL else prim


def as_light(shape: Shape, prim: ResolvedPrim, ctx: Context, links: Links | None) -> Shape:
    """Return the shape with the prim's light."""
    light = rules_of(prim, ctx, links).applied(geometry_light(prim, ctx))
    if not light.visible_to_camera:
        ctx.warn("light-input", prim.path, "A geometry light cannot be hidden from the camera: it is visible.")
    mode = sync_mode(prim, ctx)
    if mode == NO_MATERIAL:
        lamp = ctx.surfaces.index_of(LAMP)
        light = replace(light, own_color=True, shows_own=True)
        without_colors: dict[str, Any] = {"colors": None} if hasattr(shape, "colors") else {}
        return replace(shape, surface=lamp, primvars=(), light=light, **without_colors)
    if mode == GLOW and not any(_glows(s) for s in _surfaces(shape, ctx)):
        message = "materialGlowTintsLight multiplies the light by its material's emission, which is 0: it emits nothing."
        ctx.warn("light-dark", prim.path, message, "light:materialSyncMode")
    return replace(shape, light=replace(light, own_color=mode == INDEPENDENT))


def _surfaces(shape: Shape, ctx: Context) -> list[Surface]:
    all_surfaces = list(ctx.surfaces)
    return [all_surfaces[i] for i in np.unique(np.atleast_1d(np.asarray(shape.surface))).tolist() if i >= 0]


def _glows(surface: Surface) -> bool:
    return any(surface.emissive_color) or any(name == "emissive_color" for name, _ in surface.inputs)
