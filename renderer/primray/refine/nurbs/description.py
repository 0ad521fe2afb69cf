"""Dicing of all NURBS patches in a scene description."""

from __future__ import annotations

from dataclasses import replace

from ...description import NurbsPatch, SceneDescription
from ..dice import Dicing, Warnings
from ..footprint import footprints
from .grid import Fineness
from .patches import dice_patches


def with_patches_diced(description: SceneDescription, dicing: Dicing) -> tuple[SceneDescription, Warnings]:
    """Return the description with every NurbsPatch diced to triangles, and warnings about coarser edges and trim loops without
    effect."""
    patches = {k: s for k, s in enumerate(description.shapes) if isinstance(s, NurbsPatch)}
    if not patches:
        return description, []
    fine = Fineness(dicing.pixels, dicing.flatness, dicing.max_level)
    made, pixels = dice_patches(patches, footprints(description, NurbsPatch), fine, dicing.max_triangles)
    warnings: Warnings = []
    if pixels > dicing.pixels:
        sentence = f"NURBS patches have edges of {pixels:g} pixels instead of {dicing.pixels:g}, to limit their triangles."
        warnings.append(("dicing-limited", "", sentence))
    shapes = list(description.shapes)
    for k, patch in patches.items():
        found = made[k]
        shapes[k] = found.mesh
        if found.is_limited:
            sentence = f"Edges cover more than {pixels:g} pixels even at level {dicing.max_level}, the finest."
            warnings.append(("dicing-limited", patch.path, sentence))
        if found.empty_loops:
            sentence = f"{found.empty_loops} of {len(patch.loops)} trim loops enclose no area: they are ignored."
            warnings.append(("nurbs-data", patch.path, sentence))
    return replace(description, shapes=tuple(shapes)), warnings
