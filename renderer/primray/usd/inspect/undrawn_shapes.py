"""Reasons why shapes or lights of a stage are not drawn: for messages about empty pictures and stages without light, and for
`primray doctor`."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

from pxr import Sdf, Usd, UsdGeom, UsdLux

from ...settings import RenderSettings
from ..render_settings.render_settings import products
from ..stage.messages import scene_errors
from ..stage.reads import purpose_of
from ..stage.traversal import all_prims, is_in_world, prototypes_outside_world, world_prims_in_instances
from ..stage.values import When, is_hidden, read, when_of

MOST_PRIMS = 1_000_000  # prims checked at most; those of instances count each time


def count_undrawn_shapes(stage: Usd.Stage, settings: RenderSettings) -> dict[str, int]:
    """Return the number of shapes by the first reason that applies; "" where none does."""
    found = undrawn_shapes(stage, settings, drawn=True)
    return dict(sorted(((why, len(paths)) for why, paths in found.items()), key=lambda item: -item[1]))


def undrawn_lights(stage: Usd.Stage, settings: RenderSettings) -> dict[str, list[str]]:
    """Return paths of lights by why they are not drawn, and those without a reason under ""."""
    return undrawn_shapes(stage, settings, drawn=True, is_wanted=lambda prim: prim.HasAPI(UsdLux.LightAPI))


def _is_shape(prim: Usd.Prim) -> bool:
    return bool(prim.IsA(UsdGeom.Gprim))


@scene_errors()
def undrawn_shapes(
    stage: Usd.Stage, settings: RenderSettings, drawn: bool = False, is_wanted: Callable[[Usd.Prim], bool] = _is_shape
) -> dict[str, list[str]]:
    """Return paths of shapes by why they are not drawn; with `drawn`, those without a reason too, under "".

    `is_wanted` chooses other prims than shapes.
    """
    purposes = settings.purposes or products(stage, settings)[0].purposes
    when = when_of(stage, settings.time_code)
    found: dict[str, list[str]] = {}
    any_shape = False
    in_pass = "" if settings.render_pass is None or not drawn else f"left out by the render pass {settings.render_pass}"
    for prim in islice(world_prims_in_instances(stage.GetPseudoRoot()), MOST_PRIMS):
        if is_wanted(prim):
            any_shape = True
            why = _why(prim, purposes, when) or in_pass
            if why or drawn:
                found.setdefault(why, []).append(str(prim.GetPath()))
    for path, why in _elsewhere(stage, purposes, when, is_wanted).items():
        any_shape = True
        if (why := why or in_pass) or drawn:
            found.setdefault(why, []).append(str(path))
    if not any_shape:
        absent = [prim for prim in all_prims(stage) if is_wanted(prim) and not (prim.IsActive() and is_in_world(prim))]
        if absent:
            why = "inactive, or below an abstract prim (class or over) that nothing refers to"
            found[why] = [str(prim.GetPath()) for prim in absent]
        elif drawn and stage.GetPopulationMask() != Usd.StagePopulationMask.All():
            found["what is outside the mask (--mask) is not populated"] = []
    return found


def _why(prim: Usd.Prim, purposes: tuple[str, ...], when: When) -> str:
    purpose = purpose_of(prim)
    if purpose not in purposes:
        return f"of purpose {purpose}, which is not rendered (--purposes)"
    if is_hidden(prim, when):
        return "invisible at this frame"
    return ""


def _elsewhere(
    stage: Usd.Stage, purposes: tuple[str, ...], when: When, is_wanted: Callable[[Usd.Prim], bool]
) -> dict[Sdf.Path, str]:
    """Return why wanted prims of prototypes below `class` and `over` are not drawn, "" for those that some instancer draws."""
    shapes: dict[Sdf.Path, str] = {}
    whys: dict[Sdf.Path, str] = {}  # of all prims, point instancers included
    for instancer, root, prims in prototypes_outside_world(stage):
        path = instancer.GetPath()
        around = whys[path] if path in whys else _why(instancer, purposes, when)
        for prim in islice(prims, MOST_PRIMS):
            path = prim.GetPath()
            why = _why_in_prototype(prim, root, purposes, when) or around
            whys[path] = why and whys.get(path, why)
            if is_wanted(prim):
                shapes[path] = whys[path]
    return shapes


def _why_in_prototype(prim: Usd.Prim, root: Usd.Prim, purposes: tuple[str, ...], when: When) -> str:
    """Return why a prim of a prototype is not drawn: a default purpose is the instancer's, and nothing above the root hides
    it."""
    purpose = purpose_of(prim)
    if purpose not in (*purposes, UsdGeom.Tokens.default_):
        return f"of purpose {purpose}, which is not rendered (--purposes)"
    while prim and prim.GetPath().HasPrefix(root.GetPath()):
        if prim.IsA(UsdGeom.Imageable) and read(prim, "visibility", when) == UsdGeom.Tokens.invisible:
            return "invisible at this frame"
        prim = prim.GetParent()
    return ""
