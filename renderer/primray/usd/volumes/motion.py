"""Motion of volumes: the paths of their fields, and of their instances, at the times of an exposure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from pxr import Usd

from ...arrays import Doubles
from ...description import MatrixMotion, VolumeEmission, VolumeMedium
from ...description.placement import Box, compose
from ..instancing.instances import Chain
from ..motion.attributes import animated_operations, bend_times, local_transform
from ..motion.levels import any_moves, product_at, times_of
from ..motion.matrices import MotionPrecision, path_of_rows, sampled_motion, stays_at
from ..motion.timing import Timing
from ..scene.context import Context
from ..scene.inheritance import local_matrix, transforms
from ..stage.reads import property_names
from ..stage.values import matrix


class TransformPath:
    """The product of the local transforms of prims, the innermost first, as a function of the offset from the frame."""

    def __init__(self, prims: Sequence[Usd.Prim], ctx: Context) -> None:
        cache = transforms(ctx.when)
        found: set[float] = set()
        self.moves = False
        self._locals: list[Callable[[float], Doubles] | Doubles] = []
        for prim in prims:
            names = frozenset(property_names(prim))
            moving = animated_operations(prim, names, ctx.when, ctx.timing)
            if moving:
                self.moves = True
                found.update(bend_times(moving, ctx.when, ctx.timing))
                self._locals.append(local_transform(prim, ctx.when))
            else:
                self._locals.append(matrix(local_matrix(prim, names, ctx.when, cache)[0]))
        self.times = tuple(sorted(found))

    def at(self, offset: float) -> Doubles:
        """Return the matrix (4, 4)."""
        product = np.eye(4)
        for local in self._locals:
            product = (local(offset) if callable(local) else local) @ product
        return product


def namespace_path(prim: Usd.Prim, ctx: Context) -> TransformPath:
    """Return world_from_prim over time."""
    prims: list[Usd.Prim] = []
    cache = transforms(ctx.when)
    while prim and not prim.IsPseudoRoot():
        prims.append(prim)
        if local_matrix(prim, frozenset(property_names(prim)), ctx.when, cache)[1]:
            break
        prim = prim.GetParent()
    return TransformPath(prims, ctx)


@dataclass(frozen=True, eq=False)
class FieldMotion:
    """Motion of a field that does not follow from that of its Volume."""

    at: Callable[[float], Doubles]  # offset from the frame -> (4, 4) to the group's space, or to the world
    times: tuple[float, ...]  # offsets at which the path may bend
    in_world: bool  # the matrices are to the world, whatever the instances of the Volume

    def within(self, field_from_index: Doubles) -> FieldMotion:
        """Return the motion of what is below it by a static matrix."""
        return FieldMotion(lambda offset: self.at(offset) @ field_from_index, self.times, self.in_world)


def move_together(motions: Sequence[FieldMotion | None], timing: Timing) -> bool:
    """Return whether fields keep their places relative to the first one."""
    first = motions[0]
    if first is None or any(motion is None or motion.in_world != first.in_world for motion in motions):
        return all(motion is None for motion in motions)
    offsets = [timing.offset(fraction) for fraction in (0.0, 0.37, 1.0)]
    for motion in motions[1:]:
        apart = [np.linalg.solve(first.at(offset), motion.at(offset)) for offset in offsets if motion is not None]
        if not np.allclose(apart, apart[0], rtol=1e-9, atol=1e-9 * np.abs(apart[0]).max()):
            return False
    return True


@dataclass(frozen=True, eq=False)
class VolumePlace:
    """Instances of one Volume."""

    name: str  # path of the Volume
    chains: Sequence[Chain]
    usable: npt.NDArray[np.bool_]  # which of the instances are rendered
    blur_scale: float

    @property
    def moves(self) -> bool:
        return any(map(any_moves, self.chains))


@dataclass(eq=False)
class VolumePath:
    """Instances, which move, of the media and emission that are in the index space of one field."""

    place: VolumePlace
    group_from_index: Doubles  # (4, 4) at the frame
    field_motion: FieldMotion | None
    media: list[int] = field(default_factory=list)  # their indices among the scene's
    emissions: list[int] = field(default_factory=list)

    @property
    def times(self) -> tuple[float, ...]:
        """The offsets from the frame at which the path of any instance may bend."""
        own = () if self.field_motion is None else self.field_motion.times
        return tuple(sorted({*own, *(time for chain in self.place.chains for time in times_of(chain))}))

    def rows_at(self, offset: float) -> Doubles:
        """Return world_from_index (N, 3, 4) at an offset from the frame."""
        motion = self.field_motion
        inner = self.group_from_index if motion is None else motion.at(offset)
        if motion is not None and motion.in_world:
            return inner[None, :3]
        outer = np.concatenate([product_at(chain, offset) for chain in self.place.chains])[self.place.usable]
        return compose(outer, inner[None, :3])

    def sample(self, media: list[VolumeMedium], emissions: list[VolumeEmission], precision: MotionPrecision) -> None:
        """Give volumes among the scene's media and emissions their motion, unless they stay where they are."""
        grids = [media[k].grid for k in self.media] + [emissions[k].grid for k in self.emissions]
        supports = [found for grid in grids if (found := grid.support) is not None]
        if not supports:
            return
        box: Box = np.min([low for low, _ in supports], axis=0), np.max([high for _, high in supports], axis=0)
        path = path_of_rows(self.rows_at, self.times, self.place.blur_scale, box, precision)
        if stays_at(path, self.rows_at(0.0)):
            return
        motion, steps = sampled_motion(path, precision.most)
        precision.steps.append(steps.of(self.place.name, "volumes", path.no_error))
        for k in self.media:
            media[k] = _moving(media[k], motion)
        for k in self.emissions:
            emissions[k] = _moving(emissions[k], motion)


Volume = TypeVar("Volume", VolumeMedium, VolumeEmission)


def _moving(volume: Volume, motion: MatrixMotion) -> Volume:
    return replace(volume, motion=motion)
