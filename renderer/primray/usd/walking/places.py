"""The groups that what is below one root is put into: the root's own, and one for each transform that moves there.

Leaves of such a group stand in the space of what moves, all of them where its one instance is: a car of 500 parts is one group.
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
    mover: Mover | None  # in whose space the poses are; None: they are in the root's

    def mover_below(self, pose: int, local: Local, times: Iterable[float], *, resets: bool = False) -> Mover:
        """What moves below this pose; or, where it resets the stack, below the root."""
        between: Doubles = np.eye(4) if resets else self.poses.at(pose)
        return Mover(None if resets else self.mover, between, local, times)


class Places:
    """One for each transform that moves and each motion:blurScale, since that is of all of a leaf's way to the world."""

    def __init__(self, groups: list[Group[ResolvedPrim]], own: Group[ResolvedPrim]) -> None:
        self._groups = groups
        self.own = Place(own, Poses(), None)
        self._known: dict[tuple[Mover | None, float], Place] = {(None, own.blur_scale): self.own}

    def of(self, mover: Mover | None, blur_scale: float, path: str) -> Place:
        """The place of what stands in this mover's space; a new one is called by the path."""
        known = self._known.get((mover, blur_scale))
        if known is None:
            level = MatrixInstances(IDENTITY[None]) if mover is None else level_of([mover], np.eye(4)[None])
            self.own.group.instances.append((len(self._groups), level))
            known = self._known[mover, blur_scale] = Place(Group(path, blur_scale=blur_scale), Poses(), mover)
            self._groups.append(known.group)
        return known

    def blurred(self, place: Place, pose: int, blur_scale: float, path: str) -> tuple[Place, int]:
        """The same pose among what is blurred otherwise."""
        other = self.of(place.mover, blur_scale, path)
        return other, other.poses.add(Gf.Matrix4d(place.poses.at(pose).T), ROOT)
