"""Volume prims: fields and a volume shader to media and emission, one for each placement of the prim."""

from __future__ import annotations

import numpy as np

from ...arrays import Doubles
from ...description.placement import chunks
from ..instancing.instances import Chain
from ..motion.levels import any_moves
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..scene.translated_scene import TranslatedScene
from .baking import TooLargeError, VolumeMaker
from .coefficients import UnusableShaderError
from .fields import fields_of
from .files import TOO_LARGE
from .shaders import coefficients_of, storm_fallback


def add_volume(
    scene: TranslatedScene, leaf: ResolvedPrim, group_from_prim: Doubles, chains: list[Chain], is_in_world: bool, ctx: Context
) -> None:
    """Add a Volume's media and emission; `is_in_world`: its group is the stage itself, and not a prototype."""
    scene.record.is_plain = False  # any edit is a new translation, which reads no file again
    if "extent" not in leaf.names:
        ctx.findings.unbounded_shapes.add(leaf.path)  # USD computes none for a Volume
    fields = fields_of(leaf, group_from_prim, is_in_world and leaf.mover is None, ctx)
    if not fields:
        ctx.warn("volume-field", leaf.path, "It has no field that can be read: it is not rendered.")
        return
    placed = _placements(leaf, chains, ctx)
    coefficients = coefficients_of(leaf.material, fields, leaf.path, ctx)
    maker = VolumeMaker(coefficients=coefficients, fields=fields, instances=placed, path=leaf.path, ctx=ctx)
    try:
        try:
            media, emissions = list(maker.media()), list(maker.emissions())
        except UnusableShaderError as error:
            ctx.warn("shader-ignored", leaf.path, f"Its volume shader cannot be rendered: {error}.")
            maker.coefficients = storm_fallback(fields, "its material's volume shader cannot be rendered")
            media, emissions = list(maker.media()), list(maker.emissions())
    except TooLargeError as error:
        ctx.warn(TOO_LARGE, leaf.path, f"It is not rendered: {error}.")
        return
    ctx.warn("volume-convention", leaf.path, maker.coefficients.convention)
    scene.media += media
    scene.volume_emissions += emissions


def _placements(leaf: ResolvedPrim, chains: list[Chain], ctx: Context) -> Doubles:
    """Return world_from_group (N, 4, 4) of all instances at the frame; those whose matrices are singular are left out."""
    if leaf.mover is not None or any(map(any_moves, chains)):
        ctx.warn("motion", leaf.path, "It moves while the shutter is open: volumes are not blurred.")
    rows = np.concatenate([rows for chain in chains for rows in chunks(chain)])
    found = np.zeros((len(rows), 4, 4))
    found[:, :3], found[:, 3, 3] = rows, 1.0
    with np.errstate(all="ignore"):
        usable = np.isfinite(rows).all(axis=(1, 2)) & (np.abs(np.linalg.det(np.nan_to_num(rows[:, :, :3]))) > 0)
    if not usable.all():
        count = int(np.count_nonzero(~usable))
        ctx.warn("singular-transform", leaf.path, f"{count} instances have a singular or non-finite matrix and are left out.")
    chosen: Doubles = found[usable]
    return chosen
