"""Materials of curve segments: each segment has the appearance of the subset that contains it, or that of the curves."""

from __future__ import annotations

import numpy as np

from ...curves.curve_set import CurveSet, Ints
from ...scene.bindings import Subset
from ...scene.context import Context
from ...scene.inheritance import ResolvedPrim
from ...stage.values import array, read
from ..materials.surface import Appearance, appearance_of


def segment_parts(prim: ResolvedPrim, curves: CurveSet, ctx: Context) -> tuple[list[Appearance], Ints]:
    """Return the appearances, with the curves' own first, and for each of the S drawn segments the index of its appearance."""
    parts = [appearance_of(prim, prim.material, ctx)]
    of_segment = np.zeros(int(curves.segments.sum()), np.int64)
    families: list[str | None] = [None]
    for subset in prim.subsets:
        held = _segments_of(subset, curves, ctx)
        if held is None:
            continue
        twice = np.array([family == subset.family for family in families])[of_segment[held]]
        if twice.any():
            message = f"{int(twice.sum())} of its segments are also in another subset of its family: this one is used."
            ctx.warn("subset-overlap", subset.path, message, "indices")
        families.append(subset.family)
        of_segment[held] = len(parts)
        parts.append(appearance_of(prim, subset.material, ctx))
    return parts, of_segment


def _segments_of(subset: Subset, curves: CurveSet, ctx: Context) -> Ints | None:
    """Return the drawn segments in a subset, whose indices are pairs of curve and segment within it; None and reported if they
    are out of range."""
    indices = array(read(subset.prim, "indices", ctx.when), 1, "i")
    pairs = None if indices is None or len(indices) % 2 else indices.reshape(-1, 2).astype(np.int64)
    place = np.full(curves.sizes.faces, -1)
    place[curves.drawn] = np.arange(len(curves.drawn))
    if pairs is not None and ((pairs >= 0).all() and (pairs[:, 0] < len(place)).all()):
        at = place[pairs[:, 0]]
        drawn = at >= 0
        if (pairs[drawn, 1] < curves.segments[at[drawn]]).all():
            return np.asarray(curves.first_segments[at[drawn]] + pairs[drawn, 1])
    message = f"Its indices are not pairs of a curve ({len(place)} in all) and a segment of it: the subset is ignored."
    ctx.warn("subset-ignored", subset.path, message, "indices")
    return None
