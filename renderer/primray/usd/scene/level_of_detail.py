"""Levels of detail (UsdLod): the one child of each LOD root that its override, its heuristics or its default index choose.

Heuristics of the domain `imaging` are evaluated by pxr's own functions for the camera at the frame. Between two levels the
nearer one is drawn. The other children are deactivated in a copy of the stage; roots in native instances choose separately,
which ends the instances around them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from pxr import Gf, Sdf, Tf, Usd, UsdLod

from ...diagnostics import Diagnostics
from ..camera.camera import usd_camera
from ..stage.edits import check_reach, deactivate
from ..stage.open import scratch_copy
from ..stage.reads import schemas_applied, targets, type_name
from ..stage.traversal import EXISTING_IN_INSTANCES, children, drawable_prims, is_in_world
from ..stage.values import StandIns, When, is_hidden, read
from .inheritance import transforms, world_matrix

LOD_ROOT, LOD_OVERRIDE = "LODRootAPI", "LODOverrideAPI"
DOMAIN = "imaging"
MOST_REPORTED = 50


@dataclass(frozen=True)
class Choice:
    index: float | None  # None: all of them; NaN: none
    why: str


def with_levels_chosen(stage: Usd.Stage, camera: Usd.Prim | None, when: When, diagnostics: Diagnostics) -> Usd.Stage:
    """Return a copy of the stage with one level of each root; the stage itself where no root is visible."""
    gone: set[Sdf.Path] = set()
    told = 0
    looks, prims = _Looks(camera, when), drawable_prims(stage)
    roots = [prim for prim in prims if LOD_ROOT in schemas_applied(prim)]
    if all(is_hidden(root, when) for root in roots):
        return stage
    for root in roots:
        if any(path in gone for path in root.GetPath().GetPrefixes()):
            continue
        levels = [child for child in children(root, EXISTING_IN_INSTANCES) if not child.IsA(UsdLod.Heuristic)]
        choice = _choice(root, looks)
        left_out, shown = _left_out(levels, choice)
        gone |= left_out
        told += 1
        if told <= MOST_REPORTED:
            message = f"{shown} of its {len(levels)} levels of detail, {choice.why}."
            diagnostics.add("lod-chosen", str(root.GetPath()), message, "lod:heuristics")
    if told > MOST_REPORTED:
        diagnostics.add("lod-chosen", "", f"Levels of {told - MOST_REPORTED:,} further prims were chosen too.")
    _note_missed(prims, gone, diagnostics)
    made = scratch_copy(stage)
    deactivate(made, gone)
    check_reach(made)
    return made


def _note_missed(prims: Iterable[Usd.Prim], gone: set[Sdf.Path], diagnostics: Diagnostics) -> None:
    """Report point instancers whose prototypes are in levels that are left out, while the instancers are not."""
    for instancer in prims if gone else ():
        if type_name(instancer) != "PointInstancer":
            continue
        for prototype in targets(instancer, "prototypes"):
            above = next((path for path in prototype.GetPrefixes() if path in gone), None)
            if above is not None and not instancer.GetPath().HasPrefix(above):
                message = f"Its prototype {prototype} is in {above}, a level of detail that is left out: it is not drawn."
                diagnostics.add("invalid-instancer", str(instancer.GetPath()), message, "prototypes")


def _left_out(levels: list[Usd.Prim], choice: Choice) -> tuple[set[Sdf.Path], str]:
    """Return the paths of the levels to deactivate, and what is drawn, in words."""
    if choice.index is None or not levels:
        return set(), "All"
    if math.isnan(choice.index):
        return {level.GetPath() for level in levels}, "None"
    chosen = min(max(math.ceil(choice.index - 0.5), 0), len(levels) - 1)
    others = {level.GetPath() for k, level in enumerate(levels) if k != chosen}
    return others, f"{levels[chosen].GetName()} (number {chosen})"


class _Looks:
    """Inputs of heuristics: the camera, and prims as they are at the time of the render."""

    def __init__(self, camera: Usd.Prim | None, when: When) -> None:
        self.camera, self.when = camera, when
        self._stand_ins, self._transforms = StandIns(when), transforms(when)

    def index(self, heuristic: Usd.Prim, root: Usd.Prim) -> float | None:
        """Return the level that a heuristic computes, None where it computes none."""
        if self.camera is None:
            return None
        world = world_matrix(root, self.when, self._transforms)
        time, asked = self._stand_ins.time, self._stand_ins.of(heuristic, "boundingVolume")
        try:
            if asked.IsA(UsdLod.DistanceHeuristic):
                viewpoint = Gf.Vec3d(world_matrix(self.camera, self.when, self._transforms).ExtractTranslation())
                return float(UsdLod.DistanceHeuristic(asked).ComputeLOD(viewpoint, world, time))
            if asked.IsA(UsdLod.ScreenSizeHeuristic):
                frustum = usd_camera(self.camera, self.when, self._stand_ins, self._transforms).frustum
                return float(UsdLod.ScreenSizeHeuristic(asked).ComputeLOD(frustum, world, time))
        except Tf.ErrorException:
            return None
        return None


def _choice(root: Usd.Prim, looks: _Looks) -> Choice:
    override = _override(root, looks.when)
    if override is not None:
        return override
    stands = _is_placed_once(root)
    for target in targets(root, "lod:heuristics"):
        heuristic = root.GetStage().GetPrimAtPath(target)
        if not stands or not heuristic or read(heuristic, "lod:domain", looks.when) != DOMAIN:
            continue
        index = looks.index(heuristic, root)
        if index is not None and math.isfinite(index):
            return Choice(index, f"chosen by its heuristic {target} ({index:g})")
    index = read(root, "lod:default:index", looks.when)
    why = "its default" if looks.camera is not None else "its default, since the picture has no camera of the stage"
    why = why if stands else "its default, since a point instancer places it many times"
    return Choice(float(index) if isinstance(index, int) else 0.0, why)


def _is_placed_once(prim: Usd.Prim) -> bool:
    if not is_in_world(prim):
        return False
    while prim and not prim.IsPseudoRoot():
        if type_name(prim) == "PointInstancer":
            return False
        prim = prim.GetParent()
    return True


def _override(root: Usd.Prim, when: When) -> Choice | None:
    """Return the choice of the nearest override at or above the root."""
    prim = root
    while prim and not prim.IsPseudoRoot():
        if LOD_OVERRIDE in schemas_applied(prim):
            mode = read(prim, "lod:override:mode", when)
            why = f"by the override of {prim.GetPath()}"
            if mode == "noOverride":
                return None
            if mode == "noLOD":
                return Choice(math.nan, why)
            if mode == "allLOD":
                return Choice(None, why)
            if mode == "indexedLOD":
                index = read(prim, "lod:override:index", when)
                return Choice(float(index) if isinstance(index, int | float) and math.isfinite(index) else 0.0, why)
        prim = prim.GetParent()
    return None
