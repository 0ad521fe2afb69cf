"""Conversion of curves under non-similarity matrices to prototypes of their own, so that rays are transformed to the space in
which their tubes are round; the tubes are then exactly elliptic in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Doubles
from ..description import (
    Curves,
    MatrixInstances,
    MovingInstances,
    Placed,
    Placement,
    Prototype,
    SceneDescription,
    Shape,
)
from ..description.instance_names import texts
from ..description.placement import Instances, compose

ROUND = 1e-5  # largest deviation from a similarity, relative to the matrix's size


def stretched_apart(d: SceneDescription, shapes: Sequence[Shape]) -> SceneDescription:
    """Return the description with a separate prototype for every placement of such curves, placed wherever the original was."""
    if not any(isinstance(shape, Curves) for shape in shapes):
        return d
    prototypes, placements = list(d.prototypes), list(d.placements)
    static, apart = _parted(d.static, shapes)
    for placed in apart:
        names = texts([placed.instance]) if placed.instance else None
        placements.append(Placement(len(prototypes), (MatrixInstances(placed.matrix[None, :3], names=names),)))
        prototypes.append(_alone(placed, shapes))
    for k, prototype in enumerate(d.prototypes):
        kept, apart = _parted(prototype.shapes, shapes)
        if not apart:
            continue
        prototypes[k] = replace(prototype, shapes=kept)
        for placed in apart:
            number = len(prototypes)
            prototypes.append(_alone(placed, shapes))
            placements += _again(placements, k, number, placed)
            for g, outer in enumerate(prototypes):
                if outer.placements:
                    more = tuple(_again(outer.placements, k, number, placed))
                    prototypes[g] = replace(outer, placements=(*outer.placements, *more))
    return replace(d, static=static, prototypes=tuple(prototypes), placements=tuple(placements))


def is_similar(m: Doubles) -> bool:
    """Return whether a matrix scales equally in all directions."""
    linear = m[:3, :3]
    square = linear.T @ linear
    size = np.trace(square) / 3
    return bool(size > 0 and np.abs(square - size * np.eye(3)).max() <= ROUND * size)


def _parted(placed: Sequence[Placed], shapes: Sequence[Shape]) -> tuple[tuple[Placed, ...], list[Placed]]:
    stretched = [isinstance(shapes[p.shape], Curves) and not is_similar(p.matrix) for p in placed]
    kept = tuple(p for p, is_apart in zip(placed, stretched, strict=True) if not is_apart)
    return kept, [p for p, is_apart in zip(placed, stretched, strict=True) if is_apart]


def _alone(placed: Placed, shapes: Sequence[Shape]) -> Prototype:
    return Prototype(shapes[placed.shape].path, (Placed(placed.shape, np.eye(4)),))


def _again(placements: Sequence[Placement], prototype: int, number: int, placed: Placed) -> list[Placement]:
    """Return placements of the new prototype wherever the original is, with one more matrix."""
    return [
        replace(p, prototype=number, levels=_followed(p.levels, placed.matrix[:3]))
        for p in placements
        if p.prototype == prototype
    ]


def _followed(levels: tuple[Instances, ...], inner: Doubles) -> tuple[Instances, ...]:
    last = levels[-1]
    if isinstance(last, MatrixInstances):
        return (*levels[:-1], replace(last, matrices=compose(last.matrices, inner[None])))
    if isinstance(last, MovingInstances):
        steps = np.stack([compose(step, inner[None]) for step in last.matrices])
        return (*levels[:-1], replace(last, matrices=steps, frame=compose(last.frame, inner[None])))
    return (*levels, MatrixInstances(inner[None]))
