"""Groups for the prims below one root: the root's own, and one for each moving transform there.

Leaves of such a group are in the space of the moving transform and share its one instance: a car of 500 parts is one group.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from pxr import Gf

from ...arrays import Doubles
from ...description.placement import IDENTITY, MatrixInstances
from ..moving.levels import level_of
from ..moving.mover import Local, Mover
from ..resolving.poses import ROOT, Poses
from ..resolving.resolve import ResolvedPrim
from .instances import Group


@dataclass(eq=False)
class Place:
    group: Group[ResolvedPrim]
    poses: Poses
    mover: Mover | None  # the space that the poses are in; None: the root's

    def mover_below(self, pose: int, local: Local, times: Iterable[float], *, resets: bool = False) -> Mover:
        """Return the mover of a transform below this pose or, where it resets the stack, below the root."""
        between: Doubles = np.eye(4) if resets else self.poses.at(pose)
        return Mover(None if resets else self.mover, between, local, times)


class Places:
    """Places by moving transform and motion:blurScale, since a blur scale applies to the whole path of a leaf to the world."""

    def __init__(self, groups: list[Group[ResolvedPrim]], own: Group[ResolvedPrim]) -> None:
        self._groups = groups
        self.own = Place(own, Poses(), None)
        self._known: dict[tuple[Mover | None, float], Place] = {(None, own.blur_scale): self.own}

    def of(self, mover: Mover | None, blur_scale: float, path: str) -> Place:
        """Return the place for prims in this mover's space; a new one gets this path as its name."""
        known = self._known.get((mover, blur_scale))
        if known is None:
            level = MatrixInstances(IDENTITY[None]) if mover is None else level_of([mover], np.eye(4)[None])
            self.own.group.instances.append((len(self._groups), level))
            known = self._known[mover, blur_scale] = Place(Group(path, blur_scale=blur_scale), Poses(), mover)
            self._groups.append(known.group)
        return known

    def blurred(self, place: Place, pose: int, blur_scale: float, path: str) -> tuple[Place, int]:
        """Return the same pose in the place for another blur scale."""
        other = self.of(place.mover, blur_scale, path)
        return other, other.poses.add(Gf.Matrix4d(place.poses.at(pose).T), ROOT)
