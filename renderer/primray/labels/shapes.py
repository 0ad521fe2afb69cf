"""The shapes of labelled things as triangles, in the space of their prims."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..arrays import Doubles
from .boxes import parts_of_scene
from .layers import PartNames, TaxonomyThings

if TYPE_CHECKING:
    from ..report.prepared import Prepared


@dataclass(frozen=True, eq=False)
class ThingShape:
    """The surface of a thing and of all that it holds, in its prim's own space, with the symmetries that are authored on it."""

    points: Doubles  # (N, 3)
    triangles: npt.NDArray[np.int64]  # (M, 3), counterclockwise from outside
    symmetries: Doubles  # (S, 4, 4), for points as column vectors
    axes: Doubles  # (A, 2, 3): a point and a direction


def shapes_of(prepared: Prepared, taxonomy: str, paths: Collection[str]) -> dict[str, ThingShape]:
    """Return the shapes of things by path, of those that have a surface and a regular transform."""
    assert prepared.labelled is not None
    names = PartNames(prepared.scene)
    parts = parts_of_scene(prepared.scene, np.zeros((0, 3), np.int32))
    numbers = names.number(parts)
    things = TaxonomyThings(taxonomy, prepared.labelled, names)
    places = things.places()[numbers] if len(numbers) else np.zeros(0, np.int64)
    of_things: dict[str, list[Any]] = {}
    for part, place in zip(parts.tolist(), places.tolist(), strict=True):
        for above in things.hierarchy.above(place):
            if (path := things.hierarchy.names[above]) in paths:
                of_things.setdefault(path, []).append(part)
    found = {}
    for path, own in of_things.items():
        world_from_prim = prepared.labelled.world_from(path)
        if abs(np.linalg.det(world_from_prim[:3, :3])) > 0:
            prim_from_world = np.asarray(np.linalg.inv(world_from_prim), np.float64)
            found[path] = _shape(prepared, own, prim_from_world, prepared.labelled.symmetries(path))
    return found


def _shape(prepared: Prepared, parts: list[Any], prim_from_world: Doubles, symmetries: tuple[Doubles, Doubles]) -> ThingShape:
    points, triangles, first = list[Doubles](), list[npt.NDArray[np.int64]](), 0
    for part in parts:
        own, corners = core.surface_of_part(prepared.scene, part)
        points.append(own)
        triangles.append(corners.astype(np.int64) + first)
        first += len(own)
    world = np.concatenate(points)
    return ThingShape(world @ prim_from_world[:3, :3].T + prim_from_world[:3, 3], np.concatenate(triangles), *symmetries)
